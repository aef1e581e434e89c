"""What a hover says, with bounds worked out by hand. Go to definition, the outline, renaming. The names that tokens
tell, against those that the syntax tree tells. Formatting is that of `scenegen fmt`, as one change. Positions of
editors against what Python's own codecs say.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.editors.lsp.answers import EncodedLines, definition, formatting_change, refusal, symbols, uses
from scenegen.editors.lsp.document import Document
from scenegen.editors.lsp.hover import hover
from scenegen.editors.lsp.names import DISTRIBUTION_TEXTS, index
from scenegen.errors import Source
from scenegen.lang.checker import check_text
from scenegen.lang.syntax import ast
from scenegen.lang.syntax import ast as traversal
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import format_source, print_module
from scenegen.resources import grammar_file, shipped_specs
from scenegen.search import spec_bounds

from ...lang import trees
from ...laws import examples
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


def told_by_the_tree(module):
    """(start, end) of every name that stands for a value, with the start of the local binding that it has, if any."""
    found = {}

    def walk(node, visible):
        match node:
            case ast.Name():
                start = module.source.text.index(node.id, node.start)  # parentheses belong to the node
                found[start, start + len(node.id)] = visible.get(node.id)
            case ast.Quantifier(_, variables, domain, body):
                walk(domain, visible)
                walk(body, visible | {one.id: one.start for one in variables})
            case _:
                for child in traversal.children(node):
                    walk(child, visible)

    for statement in module.statements:
        parameters = {}
        if isinstance(statement, ast.Definition):
            parameters = {one.name.id: one.name.start for one in statement.parameters}
        for expr in traversal.expressions(statement):
            is_body = isinstance(statement, ast.Definition) and expr is statement.body
            walk(expr, parameters if is_body else {})
    return found


def agree(text):
    source = Source("x.spec", text)
    module = parse(source)
    expected = told_by_the_tree(module)
    if module.bare is not None:
        return
    found = index(source)
    assert [one.start for one in found.statements] == [one.start for one in module.statements]
    values = {
        (one.start, one.end): one.local.start if one.local is not None else None
        for one in found.occurrences
        if one.role == "value"
    }
    assets = {(one.start, one.end) for one in found.occurrences if one.role == "asset"}
    assert values == {place: local for place, local in expected.items() if place not in assets}
    calls = {(one.start, one.name) for one in found.occurrences if one.role == "call"}
    # words of distributions are no functions of the spec's
    usual = calls_of(below(one.distribution for one in module.statements if isinstance(one, ast.Usually)))
    words = {(start, name) for start, name in usual if name in DISTRIBUTION_TEXTS}
    assert calls == calls_of(nodes(module)) - words
    members = {(one.start, one.name) for one in found.occurrences if one.role == "member"}
    assert members == {(node.member.start, node.member.id) for node in nodes(module) if isinstance(node, ast.Member)}
    arguments = {(one.start, one.name) for one in found.occurrences if one.role == "argument"}
    assert arguments == {
        (node.name.start, node.name.id) for node in nodes(module) if isinstance(node, ast.Argument) and node.name
    }


def calls_of(expressions):
    return {(one.function.start, one.function.id) for one in expressions if isinstance(one, ast.Call)}


def nodes(module):
    return below(expr for statement in module.statements for expr in traversal.expressions(statement))


def below(expressions):
    stack = list(expressions)
    while stack:
        node = stack.pop()
        yield node
        stack.extend(traversal.children(node))


@settings(max_examples=examples(60), deadline=None, derandomize=True)
@given(st.lists(trees.statements, min_size=1, max_size=4))
def test_tokens_and_tree_agree(statements):
    agree(print_module(ast.Module(Source("", ""), tuple(statements), None)))


@pytest.mark.parametrize("name", sorted(shipped_specs()))
def test_of_the_shipped_specs(name):
    agree(shipped_specs()[name].read_text())


MANY = """object mug, block[3] = box(1, 1, 1), tray = urdf("t.urdf", box(1, 1, 1)) at (0.5, 0.5)
const N = 3
def f(p, q = N, r = dist((0, 0), (1, 1))) =
    (forall p in block: leftOf(p, q) & exists s, t in [p, mug]: leftOf(s, t)) & leftOf(p, s)
a: forall i in 1..N: f(p = block[i], q = mug) | (forall j in 1..i: leftOf(block[j], mug)) -> leftOf(block[j], i)
"""


def test_of_a_file_with_everything():
    agree(MANY)
    found = index(Source("x.spec", MANY))
    assert [(one.kind, one.name, one.is_array) for one in found.declarations] == [
        ("object", "mug", False),
        ("object", "block", True),
        ("object", "tray", False),
        ("constant", "N", False),
        ("definition", "f", False),
        ("label", "a", False),
    ]
    tray = found.declarations[2]
    assert MANY[tray.opens : tray.closes] == 'tray = urdf("t.urdf", box(1, 1, 1)) at (0.5, 0.5)'
    parameters = [one.local for one in found.occurrences if one.local and one.local.kind == "parameter"]
    assert [MANY[one.opens : one.closes] for one in parameters[:3]] == ["p", "q = N", "r = dist((0, 0), (1, 1))"]


def test_broken_texts_keep_their_names():
    text = "object mug, plate\nconst NEAR = = 3\ndef f(p = leftOf(p, mug\ntask: forall i in 1..3: leftOf(mug, i\nsafe: "
    found = index(Source("x.spec", text))
    assert [one.name for one in found.declarations] == ["mug", "plate", "NEAR", "f", "task", "safe"]
    (last,) = (one for one in found.occurrences if one.name == "i" and one.role == "value")
    assert last.local is not None and last.local.kind == "variable"


@pytest.mark.parametrize(
    "text", ["", "#", "\n\n", "object", "def", "def f", "def f(", ")", ":", "forall", "a.b.", "[("]
)
def test_scraps(text):
    document = Document(text)
    assert [one.start for one in document.index.statements] in ([], [0])
    assert document.values is not None and document.functions["leftOf"].source.name == "prelude.spec"


MESSY = "# t\nobject mug,plate\n\n\n\nconst A=1 # one\ntask:leftOf(mug ,plate)\nsafe: leftOf(mug, plate)\n"


@pytest.mark.parametrize(
    "text", [MESSY, MESSY.rstrip(), MESSY + "\n\n", "  leftOf(a,b)", "a:leftOf(a ,b)\nb: leftOf(a, b)", "leftOf(a, b)"]
)
def test_the_change_makes_it_canonical(text):
    document = Document(text)
    change = formatting_change(document)
    assert text[: change.start] + change.text + text[change.end :] == format_source(document.source)


def test_lines_that_are_right_are_left_alone():
    change = formatting_change(Document("object a, b\nt:leftOf(a,b)\nu: leftOf(a, b)\n"))
    assert (change.text, change.start) == ("t: leftOf(a, b)\n", len("object a, b\n"))
    assert formatting_change(Document("object a, b\nt: leftOf(a, b)\n")) is None


def test_a_broken_text_is_left_alone():
    assert formatting_change(Document("task: leftOf(a,")) is None


texts = st.text(st.sampled_from("ab \n\té≤🍵𝔸"), max_size=30)
codecs = {"utf-8": ("utf-8", 1), "utf-16": ("utf-16-le", 2), "utf-32": ("utf-32-le", 4)}


@given(texts, st.sampled_from(sorted(codecs)))
def test_every_offset_there_and_back(text, encoding):
    lines = EncodedLines(text, encoding)
    codec, size = codecs[encoding]
    for offset in range(len(text) + 1):
        before = text[:offset].split("\n")
        expected = len(before) - 1, len(before[-1].encode(codec)) // size
        assert lines.position(offset) == expected
        assert lines.offset(*expected) == offset


def test_inside_a_character_and_beyond_the_text():
    lines = EncodedLines("🍵a\nb")
    assert lines.offset(0, 1) == 0
    assert lines.offset(0, 2) == 1
    assert lines.offset(0, 99) == 2
    assert lines.offset(1, 99) == lines.offset(7, 0) == 4
    assert lines.offset(0, -1) == 0
    assert lines.position(99) == (1, 1)


@pytest.mark.parametrize("encoding", sorted(codecs))
def test_a_text_without_anything(encoding):
    assert EncodedLines("", encoding).position(0) == (0, 0)
    assert EncodedLines("", encoding).offset(0, 0) == 0


@pytest.mark.parametrize(
    ("place", "words"),
    [
        ("§usually", "where a thing usually is"),
        ("§normal", "the standard deviation"),
        ("§mug ~", "object"),
        ("§plate, 5", "object"),
        ("§cm)\nusually", ""),
        ("~ §poses", "recorded poses"),
    ],
)
def test_words_of_where_things_usually_are(place, words):
    text = "object mug, plate\nusually mug ~ normal(plate, 5 cm)\nusually plate ~ poses([(0.1, 0.2, 0)], 1 cm, 5 deg)\n"
    document, offset = at_cursor((text + "task: leftOf(mug, plate)").replace(place.replace("§", ""), place, 1))
    found = hover(document, offset)
    assert words in found.markdown if words else found is None or found.markdown
