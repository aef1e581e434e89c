"""Go to definition, the outline, renaming."""

import numpy as np
import pytest

from scenegen.editors.lsp.answers import definition, refusal, symbols, uses
from scenegen.editors.lsp.document import Document
from scenegen.lang.checker import check_text
from scenegen.resources import grammar_file
from scenegen.search import spec_bounds

from .marks import at_cursor

TEXT = """object plate, mug, block[3]
region mat = rect(0.2, 0, 0.8, 0.2)
const NEAR = 25 cm
def onMat(p, e = NEAR) = closeTo(p, mat, e) & (forall p1 in block: leftOf(p, p1))
safe: leftOf(mug, plate)
task: onMat(plate, e = 0.3) & onMat(p = mug) & safe -> (exists i in 1..3: leftOf(block[i], mug)) & safe
"""


def target(text, **options):
    document, offset = at_cursor(text, **options)
    place = definition(document, offset)
    if place is None:
        return None
    whole = document.text if place.text is None else place.text
    line = whole.count("\n", 0, place.start) + 1
    return (place.path.name if place.path is not None else "", line, whole[place.start : place.end])


@pytest.mark.parametrize(
    ("cursor", "place"),
    [
        ("safe: leftOf(m§ug", ("", 1, "mug")),
        ("leftOf(bl§ock[i]", ("", 1, "block")),
        ("closeTo(p, ma§t", ("", 2, "mat")),
        ("e = NEA§R)", ("", 3, "NEAR")),
        ("task: onMat§(plate", ("", 4, "onMat")),
        ("closeTo(§p, mat", ("", 4, "p")),
        ("mat, §e)", ("", 4, "e")),
        ("leftOf(p, p§1)", ("", 4, "p1")),
        ("onMat(plate, §e = 0.3", ("", 4, "e")),
        ("onMat(§p = mug", ("", 4, "p")),
        ("& sa§fe ->", ("", 5, "safe")),
        ("block[§i]", ("", 6, "i")),
        ("close§To(p, mat", ("prelude.spec", None, "closeTo")),
        ("§exists", None),
        ("onMat(plate, e = 0.§3", None),
    ],
)
def test_where_a_name_is_declared(cursor, place):
    found = target(TEXT.replace(cursor.replace("§", ""), cursor, 1))
    if place is None or place[1] is None:
        assert found == place or (found[0], found[2]) == (place[0], place[2])
    else:
        assert found == place


def test_a_prelude_name_leads_into_the_prelude_file():
    document, offset = at_cursor("left§Of(mug, plate)")
    place = definition(document, offset)
    assert place.path == grammar_file("prelude.spec")
    assert place.path.read_text()[place.start :].startswith("leftOf(a, b) = ")


def test_a_constant_of_ones_own_takes_the_place_of_the_prelude_s():
    assert target("const EPS_CLOSE = 1 cm\nt: dist(a, b) <= EPS_CL§OSE") == ("", 1, "EPS_CLOSE")
    assert target("t: dist(a, b) <= EPS_CL§OSE")[0] == "prelude.spec"


def test_objects_that_nobody_declared():
    """The first mention of the name."""
    document, offset = at_cursor("leftOf(mug, plate) & aboveOf(m§ug, plate)")
    place = definition(document, offset)
    assert (place.path, place.start) == (None, document.text.index("mug"))
    assert target("object plate\nt: leftOf(mu§g, plate)") is None


def test_across_files(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "mats.spec").write_text('import "../sizes.spec"\nregion mat = rect(0, 0, SIZE, SIZE)\n')
    (tmp_path / "sizes.spec").write_text("# sizes\nconst SIZE = 0.3\n")
    path = tmp_path / "main.spec"
    head = 'import "parts/mats.spec"\nobject a\n'
    assert target(head + "t: leftOf(a, ma§t)", path=path) == ("mats.spec", 2, "mat")
    assert target(head + "t: x(a) <= SI§ZE", path=path) == ("sizes.spec", 2, "SIZE")
    assert target('import "parts/ma§ts.spec"', path=path) == ("mats.spec", 1, "")
    assert target('import "parts/no§ne.spec"', path=path) is None
    assert target('import "../../etc/pass§wd"', path=path) is None


def test_the_outline():
    found = symbols(Document(TEXT))
    assert [(one.kind, one.name) for one in found] == [
        ("object", "plate"),
        ("object", "mug"),
        ("object", "block"),
        ("region", "mat"),
        ("constant", "NEAR"),
        ("definition", "onMat"),
        ("label", "safe"),
        ("label", "task"),
    ]
    assert all(one.opens <= one.start < one.end <= one.closes for one in found)
    assert found[4].detail == "25 cm"


RENAMED = ["mug", "block", "mat", "NEAR", "onMat", "safe", "p, e", "e = NEAR", "p1 in", "i in"]


@pytest.mark.parametrize("name", RENAMED)
def test_renaming_keeps_the_meaning(name):
    """The bounds of phi of every label, and what `check` says, are those of the text before."""
    document = Document(TEXT)
    places = uses(document, TEXT.index(name))
    old = TEXT[places[0].start : places[0].end]
    assert len(places) >= 2
    assert refusal(document, TEXT.index(name), "fresh") == ""
    text = TEXT
    for one in reversed(places):
        text = text[: one.start] + "fresh" + text[one.end :]
    before, after = check_text(TEXT), check_text(text)
    assert len(before.warnings) == len(after.warnings)
    bounds = {label.replace("fresh", old): ends for label, ends in spec_bounds(after).items()}
    assert bounds == spec_bounds(before)
    assert np.array_equal(before.box(), after.box())
    assert text.count("fresh") == len(places)


def test_a_variable_is_renamed_in_its_reach_only():
    text = "t: (forall §p in [a, b]: leftOf(p, c)) & (forall p in [b, c]: leftOf(a, p)) & aboveOf(p, a)"
    document, offset = at_cursor(text)
    assert [document.text[: one.start].count("(") for one in uses(document, offset)] == [1, 2]


@pytest.mark.parametrize(
    ("place", "name", "reason"),
    [
        ("mug, block", "plate", "`plate` means something else already"),
        ("mug, block", "forall", "`forall` is a word of the language"),
        ("mug, block", "objects", "`objects` is a word of the language"),
        ("mug, block", "my mug", "names are made of the letters"),
        ("mug, block", "e", "`e` means something else already"),
        ("mug, block", "EPS_FAR", "`EPS_FAR` means something else already"),
        ("onMat(p, e", "closeTo", "`closeTo` means something else already"),
        ("onMat(p, e", "dist", "`dist` means something else already"),
        ("onMat(p, e", "plate", ""),
        ("p, e = NEAR", "e", "`e` means something else already"),
        ("p, e = NEAR", "p1", "`p1` means something else already"),
        ("p, e = NEAR", "i", ""),
        ("NEAR = 25", "EPS_FAR", ""),
        ("closeTo(p", "near", "only names that this file declares can be renamed"),
    ],
)
def test_what_cannot_be_renamed(place, name, reason):
    assert refusal(Document(TEXT), TEXT.index(place), name).startswith(reason)
    assert bool(refusal(Document(TEXT), TEXT.index(place), name)) == bool(reason)
