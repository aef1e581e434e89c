"""Specs over time: what the checker makes of them, and that a spec without `time` knows nothing of it."""

import time

import pytest

import scenegen
from scenegen.errors import Source, SpecError
from scenegen.lang.checker import check_file, check_text
from scenegen.lang.formula.core import Const
from scenegen.lang.formula.timed import Horizon
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import format_source
from scenegen.lang.syntax.tokens import TEMPORAL, has_time

from .trees import dump

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
NESTED = {
    "always and eventually in turn": "always eventually " * (N // 2) + "leftOf(a, b)",
    "untils to the right": "leftOf(a, b) until " * N + "leftOf(b, a)",
    "untils to the left": "(" * N + "leftOf(a, b)" + " until leftOf(b, a))" * N,
    "negations of windows": "!always[0, 1] " * N + "leftOf(a, b)",
    "nexts": "next " * 20 + "initially " * N + "leftOf(a, b)",
}


@pytest.mark.long
@pytest.mark.parametrize("name", NESTED)
def test_deep(name):
    spec = check_text(f"time 20 steps\nl: {NESTED[name]}")
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
