"""The formatter: laws over random trees with comments between any two tokens, and goldens of what people write. Laws
of the canonical print over random trees: parsing it gives the tree back, printing that the same text. Golden trees
and canonical prints: every shipped spec, and a corpus with every piece of syntax.
"""

import re
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.api.outline import Outline
from scenegen.errors import Source, SpecError
from scenegen.lang.checker import check_text
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import MAX_INDENT, PRINT_WIDTH, expand, flat, format_source, print_module
from scenegen.lang.syntax.tokens import scan

from ..laws import FULL, examples, in_full_again
from .trees import dump, expressions, horizons, ladders, statements, timed_statements, tuples

ROOT = Path(__file__).resolve().parents[2]
SPECS = sorted([*(ROOT / "specs").glob("*.spec"), ROOT / "grammar" / "prelude.spec"])
CORPUS = (ROOT / "tests" / "golden" / "lang" / "formulas.txt").read_text(encoding="utf-8").split("\n")
LINES = [line for line in CORPUS if line and not line.startswith("#")]
FOLDER = ROOT / "tests" / "golden" / "lang" / "layout"
NOWHERE = Source("", "")

# what may stand between two tokens without changing the tree
BETWEEN = st.sampled_from(
    ["", "", "", " ", "\n", "\n  ", "\n\n\n", " # c\n", "\n# own\n", "\n\n  #  two  \n  # ( three \n\n"]
)


def formatted(text):
    return format_source(Source("a.spec", text))


def comments(text):
    return sorted(token.text.rstrip() for token in scan(text) if token.kind == "comment")


def obeys_the_laws(text):
    once = formatted(text)
    assert dump(parse(Source("a.spec", once))) == dump(parse(Source("a.spec", text))), text
    assert formatted(once) == once, text
    assert comments(once) == comments(text), text
    assert once == once.strip("\n") + "\n" and "\n\n\n" not in once
    assert all(line == line.rstrip() for line in once.split("\n")), once
    return once


def strew(text, between):
    """The text with something more before each of its tokens and at its end; the grammar wants a label's `:` near."""
    strewn, end, near = "", 0, False
    for token in scan(text):
        near = near and token.text == ":"
        strewn += text[end : token.start] + ("" if near else between()) + token.text
        end, near = token.end, token.kind == "name"
    return strewn + text[end:] + between()


@st.composite
def strewn(draw, modules):
    """A module's canonical text with white space and comments between its tokens."""
    return strew(print_module(draw(modules)), lambda: draw(BETWEEN))


bare = st.builds(ast.Module, st.just(NOWHERE), st.just(()), expressions)
files = st.builds(ast.Module, st.just(NOWHERE), tuples(statements, least=1, most=5), st.none())


@pytest.mark.long
@settings(max_examples=examples(80), deadline=None, derandomize=True)
@given(strewn(files))
def test_statements_strewn_with_comments(text):
    obeys_the_laws(text)


@settings(max_examples=examples(70), deadline=None, derandomize=True)
@given(strewn(bare))
def test_a_formula_strewn_with_comments(text):
    obeys_the_laws(text)


@settings(max_examples=examples(70), deadline=None, derandomize=True)
@given(ladders, st.integers(1, 60))
def test_a_long_formula(tree, length):
    """Names of any length make the lines break anywhere; no line is longer than it has to be."""
    name = "a" * length
    printed = print_module(ast.Module(NOWHERE, (ast.Label(ast.Name("task"), tree),), None)).replace("a", name)
    once = obeys_the_laws(printed.replace("t" + name + "sk", "task"))
    for line in once.splitlines():
        assert len(line) <= PRINT_WIDTH or len(line.split(name, 1)[0].strip()) < length + 12


@settings(max_examples=examples(70), deadline=None, derandomize=True)
@given(files)
def test_what_fits_a_line_is_printed_as_in_the_canonical_text(module):
    canonical = print_module(module)
    if all(len(line) <= PRINT_WIDTH for line in canonical.splitlines()):
        assert formatted(canonical) == canonical


@in_full_again
@pytest.mark.parametrize("line", LINES)
def test_the_corpus(line):
    comments = ("  # between\n", "\n\n # own\n")
    if FULL or len(line) % 3 == 2:
        obeys_the_laws(line)
    for comment in comments if FULL else comments[len(line) % 3 : len(line) % 3 + 1]:
        obeys_the_laws(strew(line, lambda: comment))  # noqa: B023 - called at once


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_shipped_specs_are_formatted(path):
    text = path.read_text(encoding="utf-8")
    assert obeys_the_laws(text) == text, "run `scenegen fmt` over it"


@pytest.mark.parametrize("path", sorted(FOLDER.glob("*.spec")), ids=lambda path: path.stem)
def test_what_people_write(path, golden):
    golden(f"lang/layout/{path.stem}.txt", obeys_the_laws(path.read_text(encoding="utf-8")))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("a  # one\n", "a  # one\n"),
        ("\n\n# one\n\n\n\na", "# one\n\na\n"),
        ("(a & # one\nb)", "a  # one\n& b\n"),
        ("a\n# one\n& b", "a\n# one\n& b\n"),
        ("a &\n# one\nb", "a\n# one\n& b\n"),
        ("task: a\n# one\n\n\n# two\nsafe: b", "task: a\n# one\n\n# two\nsafe: b\n"),
        ("task: a\n    # one\n# two\nsafe: b", "task: a\n    # one\n# two\nsafe: b\n"),
        ("  task: a\n  # one\n  safe: b", "task: a\n# one\nsafe: b\n"),
        ("task: a safe: b # one", "task: a\nsafe: b  # one\n"),
        ("task: f(a, # one\n b # two\n)", "task:\n    f(\n        a,  # one\n        b  # two\n    )\n"),
        ("task: f(a # one\n, b)", "task:\n    f(\n        a,  # one\n        b\n    )\n"),
        ("const # one\nA = 1", "const A =  # one\n    1\n"),
        ("const\n# one\nA = 1", "# one\nconst A = 1\n"),
        ("const # one\nA # two\n= 1 # three", "const A =  # one\n    # two\n    1  # three\n"),
        ("import # one\n'a' # two".replace("'", '"'), 'import "a"  # one\n    # two\n'),
        ("object a, # one\nb", "object a,  # one\n    b\n"),
        ("p and (q ∧ r) or ¬s → ⊤ implies x(a) < 2cm", "p & (q & r) | !s -> true -> x(a) <= 2 cm\n"),
    ],
)
def test_where_comments_go(text, expected):
    assert obeys_the_laws(text) == expected


def test_nothing_is_formatted_that_does_not_parse():
    with pytest.raises(SpecError):
        formatted("task: leftOf(a b)\n")


def test_no_meaning_is_ever_lost(monkeypatch):
    """The last line of defence: a formatter gone wrong refuses to hand out its text."""
    from scenegen.lang.syntax import printer

    monkeypatch.setattr(printer, "break_lines", lambda items, comments: [flat(items).replace("&", "|")])
    with pytest.raises(AssertionError, match="change the meaning"):
        formatted("a  &  b")
    monkeypatch.setattr(printer, "break_lines", lambda items, comments: ["a &"])
    with pytest.raises(AssertionError, match="does not parse"):
        formatted("a  &  b")
    monkeypatch.setattr(printer, "break_lines", lambda items, comments: [flat(items)])
    with pytest.raises(AssertionError, match="lose a comment"):
        formatted("a # one\n & b")
    monkeypatch.setattr(printer, "expand", lambda pieces: ["b" if one == "a" else one for one in expand(pieces)])
    with pytest.raises(AssertionError, match="tokens"):
        formatted("a & b")


N = 1_200  # Python's recursion ends at 1,000


@pytest.mark.long
@pytest.mark.parametrize(
    "text",
    [
        "!" * N + "a",
        "(a & (b | " * N + "c" + "))" * N,
        "f(" * N + "a" + ")" * N,
        "(" * N + "a" + " -> b)" * N,
        "-" * N + "1",
        " + ".join(["x(a)"] * N) + " <= 1",
        "forall p in b: " * 99 + "p",
        "[" * N + "a" + "]" * N,
        " & ".join(f"leftOf(a, b)  # {i}\n" for i in range(N)),
    ],
)
def test_deep_and_long_formulas_take_linear_time_and_room(text):
    began = time.process_time()
    once = formatted("task: " + text)
    assert time.process_time() - began < 30.0
    assert len(once) < (MAX_INDENT + 40) * len(text)
    assert formatted(once) == once


def there_and_back(module):
    printed = print_module(module)
    parsed = parse(Source("printed.spec", printed))
    assert dump(parsed) == dump(module), printed
    assert (parsed.bare, parsed.statements) == (module.bare, module.statements)
    assert print_module(parsed) == printed


@settings(max_examples=examples(300), deadline=None, derandomize=True)
@given(expressions)
def test_a_formula(tree):
    there_and_back(ast.Module(NOWHERE, (), tree))


@settings(max_examples=examples(300), deadline=None, derandomize=True)
@given(ladders)
def test_the_ladder(tree):
    there_and_back(ast.Module(NOWHERE, (), tree))


@settings(max_examples=examples(150), deadline=None, derandomize=True)
@given(tuples(statements, least=1, most=5))
def test_statements(trees):
    there_and_back(ast.Module(NOWHERE, trees, None))


@settings(max_examples=examples(300), deadline=None, derandomize=True)
@given(horizons, tuples(timed_statements, most=4))
def test_over_time(horizon, trees):
    there_and_back(ast.Module(NOWHERE, (horizon, *trees), None))
    text = Source("a.spec", print_module(ast.Module(NOWHERE, (horizon, *trees), None)))
    formatted = format_source(text)
    assert format_source(Source("a.spec", formatted)) == formatted


SPECS_TREES = sorted((ROOT / "specs").glob("*.spec"))
CORPUS_TREES = ROOT / "tests" / "golden" / "lang" / "formulas.txt"
LINES_TREES = [
    line for line in CORPUS_TREES.read_text(encoding="utf-8").split("\n") if line and not line.startswith("#")
]


def tree(text, places=False):
    return dump(parse(Source("a.spec", text)), places=places)


def canonical(text):
    return print_module(parse(Source("a.spec", text)))


def expanded(checked):
    rows = []
    for label in checked.labels:
        lines, left_out = Outline(checked).lines(label)
        assert not left_out
        rows.append(f"{label}\n")
        for line in lines:
            margin = f"  [{line.unit}] {line.margin}" if line.margin else ""
            rows.append(f"{'  ' * (line.depth + 1)}{line.text}{margin}  {line.low:.9g} .. {line.high:.9g}\n")
    return "".join(rows)


@pytest.mark.parametrize("path", SPECS_TREES, ids=lambda path: path.stem)
def test_a_shipped_spec(path, golden):
    text = path.read_text(encoding="utf-8")
    checked = check_text(text, path.name)
    assert checked.source == canonical(text)
    assert checked.title or path.stem == "first", "a shipped spec opens with a sentence"
    golden(f"lang/specs/{path.stem}.txt", f"{canonical(text)}----\n{expanded(checked)}")


def test_the_canonical_lines_of_the_corpus(golden):
    assert len(LINES_TREES) == len(set(LINES_TREES)) >= 400
    golden("lang/formulas.canonical.txt", "".join(f"> {line}\n{canonical(line)}" for line in LINES_TREES))


def test_trees_of_the_corpus(golden):
    """Of few lines that together have every piece of syntax in every place where the corpus has it."""
    kinds = {line: {kind(row) for row in tree(line, True).splitlines()} for line in LINES_TREES}
    missing, shown = set().union(*kinds.values()), set()
    while missing:
        best = max(LINES_TREES, key=lambda line: len(kinds[line] & missing))
        missing -= kinds[best]
        shown.add(best)
    lines = [line for line in LINES_TREES if line in shown]
    golden("lang/formulas.trees.txt", "\n".join(f"> {line}\n{tree(line, True)}" for line in lines))


def kind(row):
    """A row of a tree without names and places."""
    return re.sub(r" @.*| '.*", "", row).strip()


@pytest.mark.long
def test_what_the_corpus_means(golden):
    """The objects, what is fixed, and every label expanded, of each text that the checker accepts."""
    parts = []
    for line in LINES_TREES:
        try:
            checked = check_text(line)
        except SpecError:
            continue
        head = f"> {line}\nobjects {', '.join(checked.objects)}\n"
        held = "".join(f"{checked.objects[place]} at {pose}\n" for place, pose in checked.fixed.items())
        regions = "".join(f"region {one.name} {one.footprint} {one.pose}\n" for one in checked.regions)
        told = "".join(f"warning[{one.code}]: {one.title}\n" for one in checked.warnings)
        parts.append(head + held + regions + expanded(checked) + told)
    assert len(parts) >= 300
    golden("lang/formulas.meaning.txt", "\n".join(parts))


@pytest.mark.parametrize("path", SPECS_TREES, ids=lambda path: path.stem)
def test_a_canonical_spec_means_the_same(path):
    first = check_text(path.read_text(encoding="utf-8"))
    again = check_text(first.source)
    assert again.source == first.source and again.sha256 == first.sha256
    assert expanded(again) == expanded(first) and again.objects == first.objects


@pytest.mark.parametrize("line", LINES_TREES)
def test_printing_is_a_fixed_point_and_keeps_the_tree(line):
    printed = canonical(line)
    assert tree(printed) == tree(line)
    assert canonical(printed) == printed


@pytest.mark.parametrize("line", LINES_TREES)
def test_a_place_begins_and_ends_with_what_was_written(line):
    for row in tree(line, places=True).splitlines():
        start, end = map(int, row.rsplit("@", 1)[1].split("-"))
        assert 0 <= start < end <= len(line), row
        assert line[start:end] == line[start:end].strip(), row
        if " Name " in f" {row}":
            assert repr(line[start:end].strip("() ")) in row


@pytest.mark.parametrize("line", LINES_TREES)
def test_the_checker_accepts_or_refuses_with_a_diagnostic(line):
    try:
        checked = check_text(line)
    except SpecError as refused:
        assert all(one.span is not None for one in refused.diagnostics)
    else:
        assert check_text(checked.source).core.nodes is not None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("p and q", "p&q"),
        ("p ∧ q", "p & q"),
        ("p ∨ q", "p or q"),
        ("¬p", "not p"),
        ("p → q", "p implies q"),
        ("⊤", "true"),
        ("⊥", "false"),
        ("∀ i in 1..2: p", "forall i in 1..2: p"),
        ("∃ i in 1..2: p", "exists i in 1..2: p"),
        ("x(a) ≤ 1 ≥ y(a)", "x(a) <= 1 >= y(a)"),
        ("x(a) < 1 > y(a)", "x(a) <= 1 >= y(a)"),
        ("(p & q) | r", "p & q | r"),
        ("p -> (q -> r)", "p -> q -> r"),
        ("(((25 cm)))", "25cm"),
        ("25\xa0cm", "25cm"),
        ("25\u202fcm\u2009+\u30005\t\u2009\xa0mm", "25 cm + 5 mm"),
    ],
)
def test_spellings_share_a_tree(one, other):
    assert tree(one) == tree(other) and canonical(one) == canonical(other)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("p -> q -> r", "(p -> q) -> r"),
        ("p & q & r", "(p & q) & r"),
        ("!x(a) <= 1", "(!x(a)) <= 1"),
        ("a - b - c", "a - (b - c)"),
        ("a / b * c", "a / (b * c)"),
        ("-a * b", "-(a * b)"),
        ("forall p in a: p & q", "(forall p in a: p) & q"),
        ("25 cm", "25 m"),
    ],
)
def test_different_formulas_have_different_trees_and_texts(one, other):
    assert tree(one) != tree(other) and canonical(one) != canonical(other)
