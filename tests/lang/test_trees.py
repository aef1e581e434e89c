"""Golden trees and canonical prints: every shipped spec, and a corpus with every piece of syntax."""

from pathlib import Path

import pytest

from scenegen.api.outline import Outline
from scenegen.api.spec import Spec
from scenegen.errors import Source, SpecError
from scenegen.lang.checker import check_text
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import print_module

from .trees import dump

ROOT = Path(__file__).resolve().parents[2]
SPECS = sorted((ROOT / "specs").glob("*.spec"))
CORPUS = ROOT / "tests" / "golden" / "lang" / "formulas.txt"
LINES = [line for line in CORPUS.read_text(encoding="utf-8").split("\n") if line and not line.startswith("#")]


def tree(text, places=False):
    return dump(parse(Source("a.spec", text)), places=places)


def canonical(text):
    return print_module(parse(Source("a.spec", text)))


def expanded(checked):
    rows = []
    for label in checked.labels:
        lines, left_out = Outline(Spec(checked)).lines(label)
        assert not left_out
        rows.append(f"{label}\n")
        for line in lines:
            margin = f"  [{line.unit}] {line.margin}" if line.margin else ""
            rows.append(f"{'  ' * (line.depth + 1)}{line.text}{margin}  {line.low:.9g} .. {line.high:.9g}\n")
    return "".join(rows)


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_a_shipped_spec(path, golden):
    text = path.read_text(encoding="utf-8")
    checked = check_text(text, path.name)
    assert checked.source == canonical(text)
    assert checked.title or path.stem == "first", "a shipped spec opens with a sentence"
    parts = (tree(text, places=True), canonical(text), expanded(checked))
    golden(f"lang/specs/{path.stem}.txt", "----\n".join(parts))


def test_the_corpus(golden):
    assert len(LINES) == len(set(LINES)) >= 400
    golden("lang/formulas.trees.txt", "\n".join(f"> {line}\n{tree(line, True)}= {canonical(line)}" for line in LINES))


@pytest.mark.long
def test_what_the_corpus_means(golden):
    """The objects, what is fixed, and every label expanded, of each text that the checker accepts."""
    parts = []
    for line in LINES:
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


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_a_canonical_spec_means_the_same(path):
    first = check_text(path.read_text(encoding="utf-8"))
    again = check_text(first.source)
    assert again.source == first.source and again.sha256 == first.sha256
    assert expanded(again) == expanded(first) and again.objects == first.objects


@pytest.mark.parametrize("line", LINES)
def test_printing_is_a_fixed_point_and_keeps_the_tree(line):
    printed = canonical(line)
    assert tree(printed) == tree(line)
    assert canonical(printed) == printed


@pytest.mark.parametrize("line", LINES)
def test_a_place_begins_and_ends_with_what_was_written(line):
    for row in tree(line, places=True).splitlines():
        start, end = map(int, row.rsplit("@", 1)[1].split("-"))
        assert 0 <= start < end <= len(line), row
        assert line[start:end] == line[start:end].strip(), row
        if " Name " in f" {row}":
            assert repr(line[start:end].strip("() ")) in row


@pytest.mark.parametrize("line", LINES)
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
