"""What is offered, where. No text and no place in it makes a feature fail."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.editors.lsp.answers import definition, formatting_change, problems, refusal, symbols, uses
from scenegen.editors.lsp.completion import completions
from scenegen.editors.lsp.document import Document
from scenegen.editors.lsp.hover import hover
from scenegen.things import ASSETS

from ...laws import examples
from .marks import at_cursor

HEAD = """object plate, mug = cup
object block[3]
region mat = rect(0.2, 0, 0.8, 0.2)
region spot = circle((0.5, 0.5), 0.1)
const NEAR = 25 cm
# is p on the mat?
def onMat(p, e = NEAR) = closeTo(p, mat, e)
safe: leftOf(mug, plate)
"""
STATEMENTS = {"workspace", "object", "region", "const", "def", "require", "import"}
OPERAND = {"plate", "mug", "block", "mat", "NEAR", "onMat", "safe", "leftOf", "dist", "x", "forall", "not", "objects"}


def offered(text):
    document, offset = at_cursor(text)
    return {one.word: one for one in completions(document, offset)}


@pytest.mark.parametrize("start", ["", "# title\n", HEAD, HEAD + "con", "const A = 3\n", "  obj"])
def test_statements_open_on_a_new_line(start):
    assert offered(start + "§").keys() >= STATEMENTS


@pytest.mark.parametrize(
    "start",
    ["task: ", "task: lef", "task: leftOf(", "task: leftOf(mug, ", "task: !", "task: (", "require ", "def f(a) = "],
)
def test_operands(start):
    words = offered(HEAD + start + "§").keys()
    assert words >= OPERAND
    assert not words & {"cm", "left", "and"} and not words & STATEMENTS - {"workspace"}


@pytest.mark.parametrize("start", ["task: safe ", "task: leftOf(mug, plate) a", "task: leftOf(mug, NEAR "])
def test_operators_follow_an_operand(start):
    words = offered(HEAD + start + "§").keys()
    assert words >= {"and", "or", "implies"} and "leftOf" not in words and "object" not in words


@pytest.mark.parametrize("start", ["task: closeTo(mug, plate, 25 ", "const A = 25", "const A = 2.5c", "const A = 25 c"])
def test_units_follow_a_number(start):
    words = offered(HEAD + start + "§")
    assert words.keys() >= {"m", "cm", "mm", "rad", "deg", "turn"}
    assert words["cm"].start == len(HEAD + start.rstrip("c"))


def test_a_number_has_one_unit():
    assert "mm" not in offered("const A = 25 cm §")
    assert "mm" in offered("const A = 25 cm§")


@pytest.mark.parametrize(
    ("base", "has", "lacks"),
    [
        ("mat", {"left", "center", "topLeft", "corners", "width"}, {"first", "count"}),
        ("spot", {"left", "center", "width"}, {"topLeft", "corners", "count"}),
        ("workspace", {"left", "topLeft"}, {"count"}),
        ("block", {"first", "last", "count"}, {"left"}),
        ("objects", {"first", "last", "count"}, {"left"}),
        ("p", {"first", "left"}, set()),
        ("block[2]", {"left", "first"}, set()),
        ("mug", set(), {"left", "first"}),
        ("mat.left", set(), {"left", "first"}),
    ],
)
def test_members_by_kind(base, has, lacks):
    words = offered(f"{HEAD}def f(p) = leftOf(p, {base}.§").keys()
    assert words >= has and not words & lacks
    assert words.isdisjoint({"plate", "leftOf", "and"})
    assert offered(f"{HEAD}def f(p) = leftOf(p, {base}.le§").keys() == words


def test_a_range_is_no_member():
    assert offered(HEAD + "a: forall i in 1..§").keys() >= {"NEAR", "block"}


@pytest.mark.parametrize("start", ["object a = ", "object a[3] = c", "object a = cup, b = "])
def test_assets_and_shapes(start):
    words = offered(start + "§")
    assert words.keys() >= {*ASSETS, "box", "cylinder", "prism", "urdf"} and "leftOf" not in words
    assert words["cup"].detail == "cup: circle of radius 6 cm, 7.5 cm high"
    assert words["box"].detail == "box(length, width, height)"


def test_the_name_of_an_object_picks_its_asset():
    assert offered("object §").keys() == set(ASSETS) == offered("object mug, §").keys()
    assert offered("object mug §").keys() == {"at", "on", "of"}
    assert offered("object mug of §").keys() == {"category"}


def test_what_an_object_stands_on():
    head = "region board = rect(0, 0, 1, 1) at 30 cm\nobject shelfunit, apple, low = box(1, 1, 1), can on "
    assert offered(head + "§").keys() == {"any of", "board", "shelfunit", "low", "workspace"}
    assert offered(head + "any of [board, §").keys() == {"board", "shelfunit", "low", "workspace"}
    assert offered(head + "any of [board] §").keys() == {"at", "by area"}
    assert offered(head + "shelfunit.§").keys() == {"top", "shelf[1]", "shelf[2]", "shelf[3]"}
    assert offered(head + "low.§").keys() == {"top"} and offered(head + "apple.§") == {}


def test_shapes_of_regions():
    assert offered("region r[2] = §").keys() == {"rect", "circle", "polygon"}
    assert offered("region r = §").keys() == {"rect", "circle", "polygon"}


@pytest.mark.parametrize("start", ["region ", "const ", "def ", "def f(", "def f(a, ", "t: forall ", "t: forall i, "])
def test_a_new_name_is_not_offered(start):
    assert offered(HEAD + start + "§") == {}


def test_parameters_and_variables_where_they_count():
    inside = HEAD + "def g(first, size = §) = forall k in block: leftOf(first, k)"
    assert not {"first", "k"} & offered(inside).keys()
    assert {"first", "size"} <= offered(HEAD + "def g(first, size = 3) = §").keys()
    assert {"first", "k"} <= offered(HEAD + "def g(first) = forall k in block: leftOf(§").keys()
    assert "k" not in offered(HEAD + "def g(first) = (forall k in block: leftOf(k, mug)) & §")
    assert "k" not in offered(HEAD + "def g(first) = forall k in §")
    assert "in" in offered(HEAD + "t: forall k §")


def test_constants_know_no_objects():
    words = offered(HEAD + "const FAR = §")
    assert words.keys() >= {"NEAR", "mat", "workspace", "dist", "EPS_CLOSE", "NORTH"}
    assert words.keys().isdisjoint({"mug", "leftOf", "safe", "FAR", "forall"})


def test_usage_is_the_detail_and_the_comment_the_meaning():
    words = offered(HEAD + "task: §")
    assert (words["onMat"].detail, words["onMat"].about) == ("onMat(p, e = NEAR)", "is p on the mat?")
    assert words["closeTo"].detail == "closeTo(a, b, e = EPS_CLOSE)"
    assert words["dist"].detail == "dist(a, b)" and "Euclidean" in words["dist"].about
    assert words["NEAR"].detail == "25 cm"


def test_named_arguments():
    assert offered(HEAD + "task: onMat(mug, §").keys() >= {"p = ", "e = "}
    assert "e = " not in offered(HEAD + "task: onMat(mug & §")


def test_the_word_so_far_is_replaced():
    document, offset = at_cursor(HEAD + "task: lef§tOf")
    (word,) = (one for one in completions(document, offset) if one.word == "leftOf")
    assert document.text[word.start : word.end] == "lef"


def test_nothing_in_comments_and_texts():
    assert offered(HEAD + "# lef§") == {}
    assert offered('object a = urdf("le§') == {}


def test_an_import_names_the_files_beside(tmp_path):
    for name in ("main.spec", "table.spec", "notes.txt"):
        (tmp_path / name).write_text("")
    document, offset = at_cursor('import "ta§"', path=tmp_path / "main.spec")
    assert [(one.word, one.start, one.end) for one in completions(document, offset)] == [("table.spec", 8, 10)]


def test_a_file_of_one_formula():
    assert offered("§").keys() >= {"leftOf", "object"}
    assert offered("leftOf(mug, plate) & closeTo(§").keys() >= {"mug", "plate"}


def test_the_word_that_is_written_is_not_offered_itself():
    """Without declarations every name is an object: the one at the cursor is not yet."""
    for text in ("task: rightO", "r", "leftOf(mug, pl"):
        assert "rightOf" in offered(text + "§") and text.split()[-1] not in offered(text + "§")
    assert "mug" in offered("leftOf(mug, pl§")


SEED = """workspace [0, 2] x [0, 1]
object plate, mug = cup, tray at (0.5, 0.5, 90 deg), block[3] = box(5 cm, 6 cm, 7 cm)
region mat = rect(0.2, 0, 0.8, y(workspace.top) / 5) # mat
const NEAR = 25 cm
import "no.spec"
def f(p, e = NEAR) = closeTo(p, mat.left, e) -> !leftOf(p, [mug, plate].first)
require leftOf(tray, mug)
t: f(plate, e = 1 / 2) & -x(mug) <= -NEAR <= 3 | f(plate)
u: (forall i in 1..2: leftOf(block[i], block[i + 1])) & t
v: exists p, q in consecutive(block): min(x(p), x(q)) <= 0.5
"""
pieces = st.sampled_from(
    [*'()[],:.=&|!§#"\n ', "forall ", "def ", "x", "1..", "25 cm", "mug", "object ", "a: ", "∀", "\r", "\0"]
)


@settings(max_examples=examples(25), deadline=None, derandomize=True)
@given(
    st.integers(0, len(SEED)),
    st.integers(0, 60),
    st.lists(pieces, max_size=4),
    st.integers(0, len(SEED)),
    st.booleans(),
)
def test_mutations(at, cut, new, cursor, near):
    text = SEED[:at] + "".join(new) + SEED[at + cut :]
    document = Document(text)
    offset = min(at + len("".join(new)) if near else cursor, len(document.text))
    for item in completions(document, offset):
        assert 0 <= item.start <= item.end <= len(document.text)
    for found in (hover(document, offset), *symbols(document), *uses(document, offset), *problems(document)):
        assert found is None or 0 <= found.start <= found.end <= len(document.text)
    definition(document, offset)
    refusal(document, offset, "fresh")
    formatting_change(document)


def test_every_place_of_a_good_text():
    document = Document(SEED.replace('import "no.spec"\n', ""))
    assert [one.severity for one in problems(document)] == []
    for offset in range(0, len(document.text) + 1, 9):
        hover(document, offset)
        completions(document, offset)
        definition(document, offset)


def test_distributions_stand_after_the_sign_and_in_a_list_after_it():
    distributions = {"normal", "uniform", "poses"}
    for start in ("usually mug ~ ", "usually theta(mug) ~ [", "usually mug ~ [uniform(mat): 7, "):
        words = offered(HEAD + start + "§")
        assert words.keys() >= distributions and "leftOf" not in words, start
    for start in ("usually mug ~ normal(", "usually mug ~ [normal((", "task: "):
        assert not distributions & offered(HEAD + start + "§").keys(), start
    assert "usually" in offered(HEAD + "\n§")


@pytest.mark.parametrize("after", ["", "\ntask: leftOf(mug, plate)", " ~ normal(mat, 5 cm)"])
def test_things_stand_before_the_sign_and_regions_in_uniform(after):
    head = HEAD + "object tray at (0.5, 0.5)\n"
    for start in ("usually ", "usually m", "usually mug, ", "usually theta(mug), th"):
        assert offered(head + start + "§" + after).keys() == {"plate", "mug", "block", "theta"}, start
    assert offered(head + "usually theta(§" + after).keys() == {"plate", "mug", "block"}
    assert offered(head + "usually mug ~ [uniform(§").keys() == {"mat", "spot", "workspace"}
    assert offered(head + "usually block[§" + after).keys() >= {"NEAR"}


def test_tables_of_recorded_poses_are_offered(tmp_path):
    for name in ("logs.csv", "other.spec", "notes.txt"):
        (tmp_path / name).write_text("")
    document, offset = at_cursor(HEAD + 'usually mug ~ poses("lo§', path=tmp_path / "my.spec")
    assert [one.word for one in completions(document, offset)] == ["logs.csv"]
