"""How problems are shown, and how names are guessed."""

import json
import math
import pickle
import re
from pathlib import Path

import numpy as np
import pytest

from scenegen.cli.output import flag
from scenegen.errors import (
    DataError,
    Kind,
    OutputError,
    RequestError,
    ScenegenError,
    Source,
    Span,
    SpecError,
    nearest,
    quote_names,
    render,
    render_all,
    to_json,
)

LONG = "a" * 150 + "HERE" + "b" * 150


def at(text, what, label="here", **more):
    start = text.index(what) if what else len(text)
    return problem(label=label, **more)(Span(Source("a.spec", text), start, start + len(what)))


def problem(title="something is wrong", **texts):
    """A kind that says just these words."""
    return Kind("some-code", title, **texts)


CASES = {
    "one line": at("one two three", "two"),
    "second line": at("first\nsecond\nthird", "second", help="do this"),
    "line nine to ten": at("\n" * 9 + "tenth", "tenth", note="first\nsecond", help="one\ntwo"),
    "several lines": at("one (two\nthree\nfour) five", "(two\nthree\nfour)"),
    "a tab before": at("\tone\ttwo", "two"),
    "a tab inside": at("one\ttwo three", "one\ttwo"),
    "other letters": at("ä ∧ ü wrong", "wrong"),
    "control characters": at("a\x07b\x1b[31mc wrong", "wrong"),
    "a long line, middle": at(LONG, "HERE"),
    "a long line, start": at("HERE" + "b" * 300, "HERE"),
    "a long line, end": at("a" * 300 + "HERE", "HERE"),
    "a long line, after its end": at("a" * 300, ""),
    "a long span": at(LONG, LONG[10:290]),
    "end of file": at("one\ntwo", ""),
    "end of file after a line break": at("one\n", ""),
    "an empty text": at("", ""),
    "carriage returns": at("one\r\ntwo wrong\r\n", "wrong"),
    "no label": at("one two", "two", label=""),
    "a warning": at("one two", "two", severity="warning"),
    "no place": problem(help="mend it")(),
    "a title alone": problem()(),
}


def test_renderings(golden):
    golden("errors/rendered.txt", "\n\n".join(f"> {name}\n{render(one)}" for name, one in CASES.items()) + "\n")


def test_in_colour(golden):
    shown = "\n\n".join(render(CASES[name], color=True) for name in ("line nine to ten", "a warning", "no place"))
    golden("errors/in_colour.txt", shown.replace("\x1b", "ESC") + "\n")


@pytest.mark.parametrize("name", CASES)
def test_colour_changes_nothing_but_colour(name):
    colored = render(CASES[name], color=True)
    assert re.sub(r"\x1b\[[\d;]*m", "", colored) == render(CASES[name])
    assert colored != render(CASES[name]) and "\x1b" not in render(CASES[name])


@pytest.mark.parametrize("name", [name for name, one in CASES.items() if one.span and one.span.start < one.span.end])
def test_the_carets_stand_under_the_text_they_mean(name):
    span = CASES[name].span
    shown, carets = render(CASES[name]).splitlines()[3:5]
    marked = "".join(char for char, mark in zip(shown, carets, strict=False) if mark == "^").rstrip(".")
    meant = span.text.split("\n")[0].replace("\t", "    ")
    assert marked and meant.startswith(marked)
    assert max(len(line) for line in render(CASES[name]).splitlines()) < 240


def test_positions_count_characters_from_one():
    source = Source("a.spec", "ä∧\n\n\tx")
    assert [source.position(offset) for offset in range(7)] == [(1, 1), (1, 2), (1, 3), (2, 1), (3, 1), (3, 2), (3, 3)]
    assert source.position(-5) == (1, 1) and source.position(99) == (3, 3)
    assert [source.line(offset) for offset in (0, 2, 3, 4, 99)] == ["ä∧", "ä∧", "", "\tx", "\tx"]
    assert Span(source, 5, 6).place == "a.spec:3:2" and Span(source, 5, 6).text == "x"


KNOWN = ["leftOf", "rightOf", "closeTo", "EPS_CLOSE", "EPS_FAR", "NORTH", "mug", "plate"]


@pytest.mark.parametrize(
    ("name", "match"),
    [
        ("leftof", "leftOf"),
        ("LEFTOF", "leftOf"),
        ("left_of", "leftOf"),
        ("lefOf", "leftOf"),
        ("closeTwo", "closeTo"),
        ("eps_close", "EPS_CLOSE"),
        ("EPSCLOSE", "EPS_CLOSE"),
        ("Mug", "mug"),
        ("plte", "plate"),
        ("spoon", None),
        ("zzz", None),
        ("", None),
    ],
)
def test_nearest(name, match):
    assert nearest(name, KNOWN) == match


def test_nearest_does_not_depend_on_the_order_of_the_names():
    assert nearest("EPS_CLSE", reversed(KNOWN)) == nearest("EPS_CLSE", KNOWN) == "EPS_CLOSE"
    assert nearest("Ab", {"aB", "AB"}) == nearest("Ab", ["AB", "aB"])
    assert nearest("a", []) is None


def test_nearest_names_among_the_facts_and_quoted():
    kind = Kind("some-code", "t", help=("did you mean `{nearest}`?", "else"))
    assert kind(name="leftof", known=KNOWN).help == "did you mean `leftOf`?"
    assert kind(name="spoon", known=KNOWN).help == "else"
    assert kind(name="mug", known=KNOWN).help == "else", "a name is no suggestion for itself"
    assert [quote_names([]), quote_names("a"), quote_names("ab"), quote_names("abc")] == [
        "none",
        "`a`",
        "`a` and `b`",
        "`a`, `b` and `c`",
    ]


@pytest.mark.parametrize(
    ("kind", "also"),
    [(SpecError, ValueError), (RequestError, ValueError), (DataError, ValueError), (OutputError, OSError)],
)
def test_errors_carry_their_diagnostics(kind, also):
    one, two = CASES["one line"], CASES["no place"]
    error = kind(one, two)
    assert isinstance(error, ScenegenError) and isinstance(error, also)
    assert error.diagnostics == (one, two)
    assert str(error) == f"{render(one)}\n\n{render(two)}" == render_all([one, two])
    with pytest.raises(ValueError, match="needs a diagnostic"):
        kind()


ASTRAL = "ab \U0001f36d\U0001f36d x\n\U0001f36d y\nlast"


@pytest.mark.parametrize(
    "what", ["ab", "\U0001f36d", "x", "y", "x\n\U0001f36d y", "\n", "last", "\U0001f36d x\n\U0001f36d"]
)
def test_ranges_for_machines_count_utf_16_units(what):
    """Oracle: the text as UTF-16, cut by the range, is what the span means."""
    diagnostic = at(ASTRAL, what, help="do this", note="because", severity="warning")
    found = to_json(diagnostic)
    lines = ASTRAL.split("\n")

    def offset(place):
        line = lines[place["line"]].encode("utf-16-le")[: 2 * place["character"]].decode("utf-16-le")
        return sum(len(one) + 1 for one in lines[: place["line"]]) + len(line)

    assert ASTRAL[offset(found["range"]["start"]) : offset(found["range"]["end"])] == what
    assert (found["severity"], found["message"], found["file"]) == ("warning", "something is wrong", "a.spec")
    assert (found["label"], found["help"], found["note"]) == ("here", "do this", "because")
    assert json.loads(json.dumps(found)) == found


def test_data_of_a_problem_without_a_place():
    assert to_json(CASES["no place"]) == {
        "code": "some-code",
        "severity": "error",
        "message": "something is wrong",
        "label": "",
        "help": "mend it",
        "note": "",
        "facts": {},
    }


def test_facts_as_data():
    facts = {"name": "mug", "path": Path("a/b"), "high": math.inf, "at": np.float64(0.5), "count": np.int64(3)}
    facts |= {"known": ("mug", "plate"), "ends": (None, 0.5), "fine": True, "none": None, "empty": "", "also": []}
    found = to_json(problem()(**facts))["facts"]
    assert found == {
        "name": "mug",
        "path": str(Path("a/b")),
        "high": "inf",
        "at": 0.5,
        "count": 3,
        "known": ["mug", "plate"],
        "ends": [None, 0.5],
        "fine": True,
    }
    assert json.loads(json.dumps(found, allow_nan=False)) == found


@pytest.mark.parametrize("field", ["title", "label", "help", "note"])
@pytest.mark.parametrize("text", ["unknown name `{}`", "the names are " + "`{}`, " * 3, "{}", "{} {} " * 500])
def test_no_diagnostic_floods_a_terminal(field, text):
    name = "begins" + "x" * 4_000 + "ends"
    one = problem(**{"label": "l"} | {field: "{said}"})(CASES["one line"].span, said=text.format(*[name] * 1000))
    shown = render(one)
    assert len(shown) < 1500 and "begins" in shown
    assert ("ends`" in shown) == ("`" in text)
    assert name in to_json(one).get({"title": "message"}.get(field, field))


@pytest.mark.parametrize("field", ["title", "label", "help", "note"])
def test_names_from_files_do_not_steer_a_terminal(field):
    said = "cannot read a\n\x1b[31mb\x9b2J\x00.png"
    shown = render(problem(**{"label": "l"} | {field: "{said}"})(CASES["one line"].span, said=said))
    assert all(one.isprintable() for line in shown.split("\n") for one in line)
    if field in ("title", "label"):
        assert "cannot read a ·[31mb·2J·.png" in shown


def test_names_of_a_sensible_length_are_shown_whole():
    name = "x" * 80
    assert render(problem("unknown name `{name}`")(name=name)) == f"error[some-code]: unknown name `{name}`"


@pytest.mark.parametrize(
    ("name", "known", "close"),
    [
        ("usd", ["mjcf", "sdf", "json"], None),  # two letters in common make no slip
        ("fork", ["food", "cup"], None),
        ("sd", ["sdf", "mjcf"], "sdf"),
        ("gna", ["gan", "aae"], "gan"),  # neighbours that changed places
        ("leftof", ["leftOf"], "leftOf"),
        ("rigthOf", ["rightOf", "leftOf"], "rightOf"),
        ("balancd", ["balanced", "boosted"], "balanced"),
    ],
)
def test_only_what_can_be_a_slip_is_suggested(name, known, close):
    assert nearest(name, known) == close


def python(template, **facts):
    return problem(template)(**facts).title


def flags(template, **facts):
    return problem(template)(**facts).text("title", flag)


def test_templates_make_sentences_of_facts():
    assert python("{count:,} of {names:quoted}", count=1000, names=["a", "b"]) == "1,000 of `a` and `b`"
    assert python("{names:list} {names:quoted2} {names:members}", names="abc") == "a, b, c `a`, `b`, ... .a, .b, .c"
    assert (
        python("no brace {, no {} and [0, 1] x [0, 1] <= 2", names=()) == "no brace {, no {} and [0, 1] x [0, 1] <= 2"
    )
    assert python("{name}", name="{other} <timeout> [[x]]") == "{other} <timeout> [[x]]", "facts are no templates"


@pytest.mark.parametrize(
    ("facts", "said"),
    [
        ({"a": 1, "b": 2}, "x 1; b 2"),
        ({"a": 1, "b": None}, "x 1"),
        ({"b": 0}, "b 0"),
        ({"a": ""}, ""),
    ],
)
def test_what_has_no_fact_is_left_out(facts, said):
    assert problem(note="[[x {a}]][[; b {b}]]")(**facts).note == said


def test_of_several_templates_the_first_with_all_facts_is_taken():
    kind = problem(help=("{kept:?}keep", "all {n}", "no facts"))
    assert [kind(**facts).help for facts in ({"kept": 1, "n": 2}, {"n": 2}, {})] == ["keep", "all 2", "no facts"]


def test_arguments_are_named_as_the_caller_knows_them():
    assert python("give <timeout>, `<device=cpu>`") == 'give `timeout`, `device="cpu"`'
    assert (
        flags("give <timeout>, `<device=cpu>`, <keep_partial>, <n>")
        == "give --timeout, `--device cpu`, --keep-partial, -n"
    )
    assert python("<phi={label}=0:0.1>", label="task") == 'phi={"task": (0, 0.1)}'
    assert flags("<phi={label}=0:0.1>", label="task") == "--phi task=0:0.1"
    assert (python("{a:argument} is 0", a="epochs"), flags("{a:argument} is 0", a="n")) == ("`epochs` is 0", "-n is 0")
    typed = problem()(Span(Source("phi", "0.2:0.1", argument=True), 0, 3))
    assert " --> phi:1:1" in render(typed) and " --> --phi:1:1" in render(typed, spell=flag)
    assert (to_json(typed)["file"], to_json(typed, flag)["file"]) == ("phi", "--phi")


def test_problems_keep_their_kind_between_processes():
    one = at("one two", "two", help="do this").but(n=3)
    again = pickle.loads(pickle.dumps(RequestError(one))).diagnostics[0]  # noqa: S301 - our own
    assert again == one and again.kind == one.kind and again.facts == {"n": 3} and hash(again) == hash(one)
