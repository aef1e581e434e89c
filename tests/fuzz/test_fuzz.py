"""The fuzzer's first inputs of a fixed seed, and the fuzzer itself: `make fuzz` runs it for as long as one likes."""

import random
from types import SimpleNamespace

import pytest

from scenegen.lang.checker import check_text

from . import judge as judging
from .generate import Case
from .minimise import minimise
from .run import Bench, corpus, make

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
    assert COUNT * 0.1 < accepted < COUNT * 0.9, "a fuzzer that is always refused, or never, tests half of the language"


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
