"""Texts that are made to take long are refused, or checked in time that grows with their length (processor time). Each
of these once took minutes, or would have. Specs over time: what the checker makes of them, and that a spec without
`time` knows nothing of it.
"""

import time

import pytest

import scenegen
from scenegen.errors import Source, SpecError
from scenegen.lang.check import lowering
from scenegen.lang.checker import check_file, check_text
from scenegen.lang.formula.core import Const
from scenegen.lang.formula.timed import Horizon
from scenegen.lang.syntax.parse import parse, parse_tolerant
from scenegen.lang.syntax.printer import format_source
from scenegen.lang.syntax.tokens import TEMPORAL, has_time

from .trees import dump

LONG = "a" * 100_000
DIGITS = "1" * 100_000
MANY = 1000
THINGS = "object " + ", ".join(f"thing{k}" for k in range(MANY)) + "\n"

RUNS = {
    "a name before a colon": f"f({LONG}) : b",
    "a name before a bracket": f"leftOf({LONG}) (b",
    "a name before the end": f"leftOf({LONG}!",
    "a name before a number": f"leftOf({LONG} 1",
    "blanks before a colon": f"object a{' ' * 100_000}) : b",
    "lines before a colon": "a," + "\n" * 100_000 + ") : b",
    "digits before a dot": f"x(a) <= {DIGITS}.",
    "digits before digits": f"x(a) <= {DIGITS} {DIGITS}",
    "a name before `=`": f"{LONG}(a{' ' * 1000}) = b",
    "objects before a bracket": "object a[1]" + " " * 100_000 + "[2]",
}

OTHERS = {
    "many unknown names": THINGS + "".join(f"l{k}: leftOf(thin{k}x, thing1)\n" for k in range(MANY)),
    "many unknown names in one formula": THINGS + "l: " + " & ".join(f"leftOf(thin{k}x, a)" for k in range(MANY)),
    "many unknown relations": "".join(f"def fun{k}(a) = leftOf(a, b)\nl{k}: funn{k}x(b)\n" for k in range(MANY)),
    "many wrong kinds": "".join(f"const C{k} = 1\nl{k}: x(a) <= CC{k}x\n" for k in range(MANY)),
    "elements of a long array": f"object o[{MANY}]\n"
    + "".join(f"l{k}: leftOf(o[{k + 1}], o[{k + 2}])\n" for k in range(MANY - 2)),
    "neighbours of a long array": f"object o[{MANY}]\nl: forall i in 1..{MANY - 1}: leftOf(o[i], o[i + 1])",
    "gaps of a long array": f"object o[{MANY}]\nl: evenlySpaced(o)",
    "one list in many calls": f"const L = [{'(0, 0), ' * MANY}(1, 1)]"
    f" def f(l, i) = closeTo(m, l[i]) l: forall i in 1..{MANY}: f(L, i)",
    "quantifiers inside each other": "object o[2]\nl: "
    + "".join(f"forall p{k} in o: " for k in range(9000))
    + "leftOf(p0, p1)",
    "rounds of rounds": "l: forall i in 1..10000: forall j in 1..10000: x(m) <= i * j",
    "pairs of thousands": f"object o[{MANY}]\nrequire noOverlap()\nl: leftOf(o[1], o[2])",
    "parameters": f"def f({', '.join(f'p{k}' for k in range(10_000))}) = leftOf(p0, p1)\n"
    f"l: f({', '.join('m' * 10_000)})",
    "definitions": "".join(f"def f{k}(a) = leftOf(a, b)\n" for k in range(MANY)) + "l: f0(a)",
}


@pytest.mark.long
@pytest.mark.parametrize("name", [*RUNS, *OTHERS])
def test_in_good_time(name):
    text = RUNS.get(name) or OTHERS[name]
    began = time.process_time()
    try:
        check_text(text)
    except SpecError as refused:
        assert all(one.title for one in refused.diagnostics)
    if name in RUNS:
        parse_tolerant(Source("a.spec", text))
    assert time.process_time() - began < 10.0


NESTED = "".join(f"forall p{k} in [m]: " for k in range(101))
PARAMETERS = ", ".join(f"p{k}" for k in range(101))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            f"l: forall i in 1..200: closeTo(m, [{'(0, 0), ' * 400}(1, 1)][i], i)",
            "takes more than 6[0-9],[0-9]+ steps to expand",
        ),
        ("l: forall i in 1..300000: x(m) <= i", "quantifiers take more than 200,000 rounds in all"),
        ("object o[20001]\nl: leftOf(o[1], o[2])", "more than 20,000 objects"),
        (f"l: {NESTED}leftOf(p0, p1)", "more than 100 quantifiers stand inside each other"),
        (f"def f({PARAMETERS}) = leftOf(p0, p1)\nl: leftOf(a, b)", "`f` has more than 100 parameters"),
    ],
)
def test_a_spec_that_is_too_large_is_told_so(text, said, monkeypatch):
    monkeypatch.setattr(lowering, "MAX_INSIDE", 50_000)
    with pytest.raises(SpecError, match=said):
        check_text(text)


O = "object mug, plate\n"  # noqa: E741
TASK = "task: always leftOf(mug, plate)"
WORDS = sorted({*TEMPORAL, "time", "moves", "steps", "every", "one", "speed", "still", "s"})


@pytest.mark.parametrize(
    ("said", "meant"),
    [
        ("time 20 steps", Horizon(20, 1.0)),
        ("time 1 steps", Horizon(1, 1.0)),
        ("const N = 3\ntime 2 * N steps", Horizon(6, 1.0)),
        ("time [0, 10 s] every 0.5 s", Horizon(20, 0.5)),
        ("time [0, 0.3 s] every 100 ms", Horizon(3, 0.1)),
        ("time [0, 1 min] every 10", Horizon(6, 10.0)),
        ("time 100000 steps", Horizon(100_000, 1.0)),
    ],
)
def test_horizons(said, meant):
    spec = scenegen.parse(f"{said}\n{O}{TASK}")
    assert spec.horizon == meant and spec.moves == "one" and spec.objects == ("mug", "plate")
    assert scenegen.parse(f"{said}\nmoves all\n{O}{TASK}").moves == "all"


def test_windows_in_steps_and_in_seconds_are_the_same():
    def nodes(window):
        return check_text(f"time [0, 10 s] every 0.5 s\n{O}task: always{window} leftOf(mug, plate)").timed.nodes[1:]

    assert [(one.lowest, one.highest) for one in nodes("[1, 3 s]")] == [(1, 6)]
    assert [(one.lowest, one.highest) for one in nodes("[500 ms, 6]")] == [(1, 6)]
    assert [(one.lowest, one.highest) for one in nodes("")] == [(0, 20)]


@pytest.mark.parametrize("word", WORDS)
def test_a_spec_without_time_can_use_the_words_as_names(word):
    """Objects, labels, definitions, constants and variables; the tree is the one that any other name gives."""
    text = (
        f"object {word}, plate, cup[2]\nconst C = 2\ndef d({word}_) = leftOf({word}_, {word})\n"
        f"a: d(plate) & (forall {word}_2 in [cup[1], {word}]: leftOf({word}_2, plate))\n"
    )
    other = text.replace(f"{word}_", "other_").replace(word, "mug") if word not in ("s", "one") else text
    assert not has_time(text)
    assert check_text(text).timed is None
    if other is not text:
        assert dump(parse(Source("", text))).replace(f"'{word}", "'mug") == dump(parse(Source("", other))).replace(
            "other_", "mug_"
        )
    spec = check_text(f"object a, b\n{word}: leftOf(a, b)\nl: {word} | leftOf(b, a)")
    assert spec.labels == (word, "l") and spec.timed is None
    spec = check_text(f"object a[3], b\nconst {word} = 2\nl: leftOf(a[{word}], b) & x(b) <= 5 m/{word}")
    assert spec.timed is None
    check_text(f"object {word}[3], b\nl: leftOf({word}[1], b)")


def test_units_of_time_are_names_without_it():
    spec = check_text("object a, b\nconst s = 4\nl: x(a) <= 20 cm/s")
    assert Const(0.05) in spec.core.nodes
    assert check_text("object a, b\nm: x(b) <= 2 s: leftOf(a, b)").labels == ("m", "s")
    timed = check_text("time 2 steps object a l: always speed(a) <= 20 cm/s")
    assert Const(0.2) in timed.timed.state.nodes


def test_a_function_of_steps_can_be_defined_where_there_is_no_time():
    spec = check_text("object a, b\ndef speed(p) = leftOf(p, b)\nl: speed(a)")
    assert spec.timed is None and spec.source.splitlines()[1] == "def speed(p) = leftOf(p, b)"


def test_the_canonical_text_means_the_same():
    spec = check_text(
        "time [0, 10 s] every 0.5 s # a comment\nmoves all\nobject mug, plate\n"
        "require speed(mug) <= 20 cm/s & forall p in objects: spin(p) <= 30 deg/s\n"
        "def near(p, q) = eventually[0, 5 s] closeTo(p, q)\n"
        "task: (near(mug, plate)) until_with (initially still(mug)) & finally (x(mug) <= 0.5)\n"
    )
    again = check_text(spec.source)
    assert again.source == spec.source and again.sha256 == spec.sha256
    assert again.timed.nodes == spec.timed.nodes and again.timed.labels == spec.timed.labels
    assert format_source(Source("", spec.source)) == spec.source
    assert "# a comment" in format_source(Source("", f"{spec.source}# a comment"))


def test_quantifiers_over_time():
    one = check_text("time 5 steps object a[4]\nl: forall p, q in a: eventually[1, 2] (moved(p) | leftOf(p, q))").timed
    parts = " & ".join(
        f"eventually[1, 2] (moved(a[{i}]) | leftOf(a[{i}], a[{j}]))" for i in range(1, 5) for j in range(i + 1, 5)
    )
    other = check_text(f"time 5 steps object a[4]\nl: {parts}").timed
    assert len(one.nodes) == len(other.nodes) and len(one.state.nodes) == len(other.state.nodes)
    many = check_text("time 5 steps object a[12]\nl: forall p in a: forall i in 1..5: eventually[0, i] moved(p)").timed
    assert sum(type(node).__name__ == "Window" for node in many.nodes) == 60


def test_state_formulas_are_one_signal():
    """However many of them stand beside a formula over time."""
    parts = " & ".join(f"leftOf(a, b{k})" for k in range(30))
    timed = check_text(f"time 5 steps\nl: {parts} & always leftOf(b0, a)").timed
    assert len(timed.state.labels) == 2


def test_warnings_of_windows():
    spec = scenegen.parse(f"time 5 steps\n{O}task: eventually[3, 9] leftOf(mug, plate)")
    assert [one.code for one in spec.warnings] == ["window-cut"]
    spec = scenegen.parse(f"time 5 steps\n{O}task: forall i in 1..3: eventually[i, 9] leftOf(mug, plate)")
    assert len(spec.warnings) >= 1


def test_imports_are_read_as_the_spec_is(tmp_path):
    (tmp_path / "moves.spec").write_text("object mug, plate\ndef soon(p, q) = eventually[0, 2] leftOf(p, q)\n")
    (tmp_path / "timed.spec").write_text("time 3 steps\nobject mug, plate\n")

    def spec(text):
        return check_file(tmp_path / "main.spec", text.encode())

    assert spec('time 5 steps\nimport "moves.spec"\ntask: soon(mug, plate)').timed.horizon.steps == 5
    with pytest.raises(SpecError, match="`eventually` is about time") as refused:
        spec('import "moves.spec"\ntask: soon(mug, plate)')
    with pytest.raises(SpecError, match="only an imported file says how long") as refused:
        spec('import "timed.spec"\ntask: leftOf(mug, plate)')
    assert [one.code for one in refused.value.diagnostics] == ["time-in-import"]


N = 1_000
NESTED_OVER_TIME = {
    "always and eventually in turn": "always eventually " * (N // 2) + "leftOf(a, b)",
    "untils to the right": "leftOf(a, b) until " * N + "leftOf(b, a)",
    "untils to the left": "(" * N + "leftOf(a, b)" + " until leftOf(b, a))" * N,
    "negations of windows": "!always[0, 1] " * N + "leftOf(a, b)",
    "nexts": "next " * 20 + "initially " * N + "leftOf(a, b)",
}


@pytest.mark.long
@pytest.mark.parametrize("name", NESTED_OVER_TIME)
def test_deep(name):
    spec = check_text(f"time 20 steps\nl: {NESTED_OVER_TIME[name]}")
    again = check_text(spec.source)
    assert again.source == spec.source and len(again.timed.nodes) == len(spec.timed.nodes)


@pytest.mark.long
@pytest.mark.parametrize("operator", ["always ", "eventually[0, 1] ", "next ", "leftOf(a, b) until ", "finally "])
def test_a_hundred_thousand_nested_operators_are_refused_in_time(operator):
    began = time.process_time()
    with pytest.raises(SpecError, match="more than 20,000 operators of time") as refused:
        check_text(f"time 20 steps\nl: {operator * 100_000}leftOf(a, b)")
    assert refused.value.diagnostics[0].span is not None
    assert time.process_time() - began < 20.0  # linear; a busy machine costs CPU time, too


@pytest.mark.long
def test_formulas_times_moments_are_limited():
    began = time.process_time()
    with pytest.raises(SpecError, match="too many formulas over time for 100,000 steps"):
        check_text("time 100000 steps\nl: " + "always eventually " * 300 + "leftOf(a, b)")
    assert time.process_time() - began < 20.0


STATIC = {
    "sample": lambda spec: scenegen.sample(spec, n=1),
    "train": lambda spec: scenegen.train(spec, "flow", out="model.pt"),
    "robustness": lambda spec: spec.robustness(),
    "infeasible": lambda spec: spec.infeasible(),
}


@pytest.mark.parametrize("name", STATIC)
def test_what_works_on_scenes_refuses_a_spec_over_time(name):
    spec = scenegen.parse(f"time 5 steps\n{O}{TASK}")
    with pytest.raises(scenegen.ScenegenError) as refused:
        STATIC[name](spec)
    assert [one.code for one in refused.value.diagnostics] == ["time-not-here"]
    assert "time 5 steps" in spec._repr_html_() and "mug" not in repr(spec)


def test_x_behind_a_window_is_the_function():
    """Behind an interval `x` is that of a workspace only where another interval follows."""
    head = "time 3 steps\nworkspace [0, 1] x [0, 1]\nobject mug\n"
    source = check_text(head + "task: always[0, 3] x(mug) <= 0.5 until[0, 2] x(mug) >= 0.1\n").source
    assert check_text(source).source == source
