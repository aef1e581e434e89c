"""What a hover says, with bounds worked out by hand."""

import pytest

from scenegen.editors.lsp.hover import hover

from .marks import CURSOR, at_cursor

SCENE = """# A table
workspace [0, 2] x [0, 1]
object plate, mug = cup, tray at (0.5, 0.5, 90 deg)
object block[4] = box(5 cm, 6 cm, 7 cm)
region mat = rect(0.2, 0, 0.8, 0.2)  # where one eats
const NEAR = 25 cm
const TWICE = 2 * NEAR
const SPOT = (0.5, NEAR)

# keeps p
# on the mat
def onMat(p, e = NEAR) = rightOf(p, mat.left) & closeTo(p, mat, e)

require leftOf(tray, mug)
task: onMat(plate) & x(mug) - x(plate) <= NEAR
row: (forall i in 1..3: leftOf(block[i], block[i + 1])) | task
never: dist(mug, plate) >= 3 m
"""


def told(place, text=SCENE):
    """The hover at the first occurrence of a piece of text, at its cursor or else its start; and what it is about."""
    marked = place if CURSOR in place else CURSOR + place
    assert place.replace(CURSOR, "") in text
    document, offset = at_cursor(text.replace(place.replace(CURSOR, ""), marked, 1))
    found = hover(document, offset)
    assert found is not None
    return found.markdown, document.text[found.start : found.end]


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("plate,", ["**object** `plate`", "plate: circle of radius 12.5 cm"]),
        ("mug =", ["**object** `mug`", "cup: circle of radius 6 cm, 7.5 cm high"]),
        ("cup,", ["**asset** `cup`", "radius 6 cm"]),
        ("tray at", ["held at (0.5, 0.5), heading 1.571 rad"]),
        ("block[4]", ["**array** `block`", "4 of box: box 5 cm x 6 cm, 7 cm high"]),
        ("mat = rect", ["region mat = rect(0.2, 0, 0.8, 0.2)", "where one eats", "centre (0.5, 0.1)"]),
        ("NEAR = 25", ["const NEAR = 25 cm", "= 0.25 m"]),
        ("TWICE", ["= 0.5 m"]),
        ("SPOT", ["= (0.5, 0.25) m"]),
        ("90 deg", ["90 deg = 1.5708 rad"]),
        ("e = NEAR", ["**parameter** `e = NEAR` of `onMat`"]),
        ("i in 1..3", ["**variable** `i` of `forall i in 1..3`"]),
        ("left)", ["`.left`: the middle of the left side", "= (0.2, 0.1) m"]),
        ("forall", ["**forall**: a formula for all", "in [-2, 2]"]),
        ("workspace", ["**workspace**: the table"]),
        ("dist", ["dist(a, b)", "Euclidean distance", "in [0, 2.236] m"]),
    ],
)
def test_what_things_are(place, words):
    markdown, _ = told(place)
    for one in words:
        assert one in markdown


@pytest.mark.parametrize(
    ("place", "low", "high", "about"),
    [
        # x(plate) - x(mat.left): 0 - 0.2 to 2 - 0.2
        ("rightOf(p", "-0.2", "1.8", "rightOf"),
        # x of the mug against a tray held at 0.5
        ("leftOf(tray", "-0.5", "1.5", "leftOf"),
        # NEAR - (x(mug) - x(plate)), each x in [0, 2]
        ("<= NEAR", "-1.75", "2.25", "x(mug) - x(plate) <= NEAR"),
        # an index runs over three pairs of neighbours, each with x in [0, 2]
        ("leftOf(block[i]", "-2", "2", "leftOf"),
        # the diagonal of the workspace is sqrt(5)
        (">= 3 m", "-3", "-0.7639", "dist(mug, plate) >= 3 m"),
    ],
)
def test_bounds_of_the_formula_under_the_cursor(place, low, high, about):
    markdown, where = told(place)
    assert f"in [{low}, {high}] m" in markdown
    assert where == about


def test_labels_have_the_bounds_of_their_formula():
    for place in ("never:", "| tas§k"):
        markdown, where = told(place)
        assert "**label**" in markdown and "phi in [" in markdown
        assert where in ("never", "task")
    assert "phi in [-3, -0.7639] m, never satisfied" in told("never:")[0]


def test_a_definition_shows_usage_comment_and_formula():
    markdown, where = told("onMat(plate)")
    assert where == "onMat"
    assert markdown.split("\n\n")[:3] == [
        "```spec\nonMat(p, e = NEAR)\n```",
        "keeps p on the mat",
        "= `rightOf(p, mat.left) & closeTo(p, mat, e)`",
    ]
    assert "phi of `onMat(plate)` in [" in markdown
    assert "phi" not in told("onMat(p,")[0]


def test_what_a_definition_comes_to_in_all_its_uses():
    """x(b) - x(a) with a held at 0.2 or at 0.7: together from -0.7 to 0.8."""
    text = (
        "object a at (0.2, 0.5), c at (0.7, 0.5), b\ndef f(p, q) = leftOf(p, q) & aboveOf(p, q)\nt: f(a, b)\nu: f(c, b)"
    )
    markdown, _ = told("leftOf", text)
    assert "phi of `leftOf(p, q)` in [-0.7, 0.8] m, over 2 uses" in markdown


def test_a_broken_statement_does_not_silence_the_rest():
    markdown, _ = told("rightOf(p", SCENE + "wish: leftOf(mug,\nconst NONSENSE = mug + 3\n")
    assert "in [-0.2, 1.8] m" in markdown


def test_mistakes_of_meaning_do_not_silence_the_rest():
    text = "object mug, plate\nbad: leftOf(mug, plat)\nworse: mug & plate\ngood: leftOf(mug, plate)"
    assert "phi of `leftOf(mug, plate)` in [-1, 1] m" in told("good: §leftOf", text)[0]
    assert "phi" not in told("bad: §leftOf", text)[0]


def test_what_always_holds():
    text = "object mug\nt: leftOf(mug, mug) | x(mug) <= 0.5"
    assert "phi of `leftOf(mug, mug)` in [0, 0]" in told("leftOf", text)[0]
    assert "phi: holds in every scene" in told("true", "object a, b\nt: leftOf(a, b) & true")[0]


@pytest.mark.parametrize("text", ["§", "# a §comment\nleftOf(a, b)", "leftOf(a, b) §\n\n", "task:§ "])
def test_where_nothing_is_there_is_nothing_to_say(text):
    document, offset = at_cursor(text)
    assert hover(document, offset) is None
