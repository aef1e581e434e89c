"""How problems are shown, and how names are guessed."""

import json
import re

import pytest

from scenegen.errors import (
    DataError,
    Diagnostic,
    OutputError,
    RequestError,
    ScenegenError,
    Source,
    Span,
    SpecError,
    nearest,
    quoted,
    render,
    render_all,
    suggest,
    to_json,
)

LONG = "a" * 150 + "HERE" + "b" * 150


def at(text, what, label="here", **more):
    start = text.index(what) if what else len(text)
    return Diagnostic("something is wrong", Span(Source("a.spec", text), start, start + len(what)), label, **more)


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
    "no place": Diagnostic("something is wrong", help="mend it"),
    "a title alone": Diagnostic("something is wrong"),
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


def test_suggest_and_quoted():
    assert suggest("leftof", KNOWN, "else") == "did you mean `leftOf`?"
    assert suggest("spoon", KNOWN, "else") == "else" and suggest("spoon", KNOWN) == ""
    assert suggest("mug", KNOWN, "else") == "else", "a name is no suggestion for itself"
    assert [quoted([]), quoted("a"), quoted("ab"), quoted("abc")] == ["none", "`a`", "`a` and `b`", "`a`, `b` and `c`"]


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
        "severity": "error",
        "message": "something is wrong",
        "label": "",
        "help": "mend it",
        "note": "",
    }


@pytest.mark.parametrize("field", ["title", "label", "help", "note"])
@pytest.mark.parametrize("text", ["unknown name `{}`", "the names are " + "`{}`, " * 3, "{}", "{} {} " * 500])
def test_no_diagnostic_floods_a_terminal(field, text):
    name = "begins" + "x" * 20_000 + "ends"
    fields = {"title": "t", "label": "l", "span": CASES["one line"].span} | {field: text.format(*[name] * 1000)}
    one = Diagnostic(**fields)
    shown = render(one)
    assert len(shown) < 1500 and "begins" in shown
    assert ("ends`" in shown) == ("`" in text)
    assert name in to_json(one).get({"title": "message"}.get(field, field))


def test_names_of_a_sensible_length_are_shown_whole():
    name = "x" * 80
    assert render(Diagnostic(f"unknown name `{name}`")) == f"error: unknown name `{name}`"


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
