"""The fuzzer's first inputs of a fixed seed, and the fuzzer itself: `make fuzz` runs it for as long as one likes.
Nothing proves that a planted scene cannot be. Hostile scene files, the first of a fixed seed; `python -m
tests.fuzz` goes on with others. The first random tables of a seed, and whether faults are found: `make fuzz-tables`
samples a hundred.
"""

import random
import time
from types import SimpleNamespace

import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.scenes.formats import header

from . import judge as judging
from . import scenefiles, tables_run
from .generate import Case
from .judge import Fault
from .minimise import minimise
from .planted import PROOFS, planted, wrong_proofs
from .run import Bench, corpus, make
from .scenefiles import good_file, hostile, judge_file
from .tables import FEWEST, Table, table
from .tables_run import FULL, PROOF, SCENES, SCENES_CAME, Run, run, summary

SEED, COUNT = 20, 60


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


@pytest.mark.long
def test_accepted_with_one_meaning_or_refused_politely(bench):
    texts = corpus()
    accepted = 0
    for number in range(COUNT):
        good, signature, story = bench.verdict(make(SEED, number, texts))
        assert not signature, f"python -m tests.fuzz --seed {SEED} --number {number}\n{story}"
        accepted += good
    assert COUNT * 0.05 < accepted < COUNT * 0.9, (
        "a fuzzer that is always refused, or never, tests half of the language"
    )


def test_the_same_number_is_the_same_input():
    texts = corpus()
    for number in range(30):
        one, other = make(SEED, number, texts), make(SEED, number, texts)
        assert (one.main, one.beside) == (other.main, other.beside)
    assert len({make(SEED, number, texts).main for number in range(30)}) > 25


def test_it_finds_what_is_wrong(bench, monkeypatch):
    """Faults that are put in on purpose: an exception, a place outside the text, another meaning, a wrong bound."""
    case = Case(b"object a, b\ntask: leftOf(a, b) & x(a) <= 0.25\n")
    assert bench.verdict(case) == (True, "", "")

    def crash(*_: object) -> None:
        raise KeyError("a")

    for name, broken, said in (
        ("check_file", crash, "KeyError"),
        ("format_source", lambda source: source.text + "# more\n", "not idempotent"),
        ("check_text", lambda text: check_text(text.replace("0.25", "0.75")), "no fixed point"),
        ("node_bounds", lambda core, low, high: [judging_interval()] * len(core.nodes), "outside its bounds"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(judging, name, broken)
            assert said in bench.verdict(case)[1], name


def test_texts_that_attack_by_their_size(bench, monkeypatch):
    """Two in a hundred; what takes too long, or too much, is found."""
    texts = corpus()
    cases = [make(SEED, number, texts, 0.02) for number in range(500)]
    big = [case for case in cases if case.sized]
    assert 2 < len(big) < 30
    small = Case(b"task: forall i in 1..300: x(a) * i <= x(b)", sized=True)
    assert bench.verdict(small) == (True, "", "")
    for name, said in (("CHECK", "check takes longer"), ("SHOW", "the outline takes longer")):
        with monkeypatch.context() as patch:
            patch.setattr(judging, name, 0.0)
            assert said in bench.verdict(small)[1]

    monkeypatch.setattr(judging, "MEMORY", 1 << 20)
    monkeypatch.setattr(judging.resource, "getrusage", grown())
    assert "check takes more than 1 MB" in bench.verdict(small)[1]


def grown():
    """The peak of memory as if each look found another 64 MB: the true one may lie far above already."""
    seen = []

    def look(who):
        seen.append(who)
        return SimpleNamespace(ru_maxrss=65_536 * len(seen))

    return look


def judging_interval():
    from scenegen.geometry import Interval

    return Interval(7.0, 8.0)


def test_inputs_with_a_fault_become_small():
    rng = random.Random(0)
    lines = [f"l{number}: leftOf(a, b{rng.random()})" for number in range(40)]
    lines[17] = "l: leftOf(a, @b)"
    small = minimise(Case("\n".join(lines).encode(), {"x.spec": b""}), lambda case: b"@" in case.main)
    assert small == Case(b"@", {})


QUICK, MANY, SAMPLED = range(1, 5), range(100, 400), range(1000, 1060)


@pytest.mark.long
@pytest.mark.parametrize("seed", QUICK)
def test_no_proof_against_a_planted_scene(seed):
    assert wrong_proofs(planted(seed), 1e5) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", MANY)
def test_no_proof_against_many_planted_scenes(seed):
    assert wrong_proofs(planted(seed)) == []


@pytest.mark.slow
@pytest.mark.parametrize("seed", SAMPLED)
def test_planted_scenes_are_found_or_not_found(seed):
    """Whole runs of `sample`: scenes, or that none were found, in time; never that there are none."""
    made = planted(seed)
    spec = scenegen.parse(made.text)
    asked = {name: (0.0, None) for name in spec.labels if made.phi[name] >= 0.0}
    try:
        scenegen.sample(spec, asked, n=10, timeout=3.0)
    except RequestError as error:
        assert not made.numbers or error.diagnostics[0].code != "no-number-possible"
        assert error.diagnostics[0].kind not in PROOFS


def test_discs_that_may_overlap_are_not_counted_as_area():
    """Each of ten plates keeps clear of a coin; among each other only their centres are apart."""
    spec = scenegen.parse(
        "object plate[10] = cylinder(0.45, 0.05)\nobject coin = cylinder(0.02, 0.05)\n"
        "require forall p in plate: gap(p, coin) >= 0\ntask: forall p, q in plate: farFrom(p, q, 1 cm)\n"
    )
    scenes = scenegen.sample(spec, (0.0, None), n=5, method="growth")
    assert len(scenes.poses) == 5


COUNT_SCENEFILES = 24


@pytest.fixture(scope="module")
def good():
    return good_file()


@pytest.mark.long
def test_read_or_refused_in_time(good, tmp_path):
    read = 0
    for number in range(COUNT_SCENEFILES):
        read += judge_file(random.Random(f"files:{number}"), good, tmp_path)
    assert 0 < read < COUNT_SCENEFILES * 0.9


def test_the_same_number_is_the_same_file(good):
    assert hostile(random.Random("7"), good) == hostile(random.Random("7"), good)


@pytest.mark.long
def test_it_finds_what_is_wrong_scenefiles(good, tmp_path, monkeypatch):
    """A reader that takes its time over keys that stand twice, as ours did: it counted every key."""

    def slow(pairs):
        if len(dict(pairs)) < len(pairs):
            until = time.process_time() + 1.0
            while time.process_time() < until:
                pass
            raise header._DuplicateKey(pairs[0][0])
        return dict(pairs)

    monkeypatch.setattr(header, "_unique", slow)
    monkeypatch.setattr(scenefiles, "SECONDS", 0.9)
    monkeypatch.setattr(scenefiles, "EACH", 0.0)
    with pytest.raises(Fault, match="bytes took"):
        for number in range(10 * COUNT_SCENEFILES):
            judge_file(random.Random(f"files:{number}"), good, tmp_path)


QUICK_TABLES = 0, 13  # one with many boxes left by pruning, one with few
EASY = "object a[3] = cylinder(0.02, 0.05)\nrequire noOverlap()\ntask: leftOf(a[1], a[2])\n"


@pytest.mark.long
@pytest.mark.parametrize("number", QUICK_TABLES)
def test_quick_tables_are_answered_with_scenes(number):
    one = run(0, number, 60.0)
    assert not one.fault, one
    assert one.kind == SCENES_CAME


def test_tables_are_valid_and_do_not_change():
    for number in range(16):
        case = table(0, number, number > 7)
        assert case == table(0, number, number > 7)
        spec = scenegen.parse(case.text)
        assert set(spec.labels) == set(case.ranges)
        assert len(spec.objects) >= FEWEST
    assert len({table(seed, 0).text for seed in range(8)}) == 8


def test_wrong_scenes_are_found(tmp_path):
    out = tmp_path / "scenes.json"
    scenegen.sample_to(out, scenegen.parse(EASY), {"task": (0.0, None)}, SCENES)
    ranges = {"task": (0.0, None)}
    assert tables_run._verify(Table(EASY, ranges), out) == ("rejection", "")
    assert "out of range" in tables_run._verify(Table(EASY, {"task": (0.5, None)}), out)[1]
    closer = EASY.replace("noOverlap()", "noOverlap() & closeTo(a[1], a[2], 1 cm)")
    assert "requires" in tables_run._verify(Table(closer, ranges), out)[1]


def test_scenes_that_were_overlooked_are_found(monkeypatch):
    monkeypatch.setattr(tables_run, "PLAIN", 0.1)
    assert "plain rejection finds" in tables_run._plain(Table(EASY, {"task": (0.0, None)}))
    assert tables_run._plain(Table(EASY, {"task": (0.999, None)})) == ""


@pytest.mark.long
def test_answers_are_told_apart(monkeypatch):
    """A proof is an answer; an error that nobody knows is a fault."""
    monkeypatch.setattr(tables_run, "PLAIN", 0.1)
    hopeless = Table(EASY + "safe: x(a[1]) >= 2\n", {"safe": (0.0, None)})
    monkeypatch.setattr(tables_run, "table", lambda *_: hopeless)
    one = run(0, 0, 60.0)
    assert (one.kind, one.fault) == (PROOF, "")
    broken = Table("object a\ntask: leftOf(a, \n", {"task": (0.0, None)})
    monkeypatch.setattr(tables_run, "table", lambda *_: broken)
    assert run(0, 0, 60.0).fault == "an unknown answer"
    lines = summary([one, Run(1, FULL, "-", 1.0, 1.0, 1, "")])
    assert "1 of 2 proof" in lines
    assert "faults: none" in lines
