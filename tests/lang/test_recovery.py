"""Several syntax errors from one run: every broken statement is reported once, whole ones never are."""

import json
import time
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.errors import Source, SpecError, render, to_json
from scenegen.lang.syntax.parse import MOST_ERRORS, parse, parse_tolerant
from scenegen.lang.syntax.printer import format_source, print_module

from ..laws import FULL, examples, in_full_again

ROOT = Path(__file__).resolve().parents[2]
ERRORS = sorted((ROOT / "tests" / "golden" / "lang" / "errors").glob("*.spec"))
SPECS = sorted((ROOT / "specs").glob("*.spec"))

WHOLE = [
    "workspace [0, 1] x [0, 1]",
    "object mug, plate",
    "object block[7] = box(1, 2, 3) at (0.5, 0.5)",
    "const A = (1 + 2) * 3 cm  # task: (",
    "def f(a, b = A) = leftOf(a, b)\n    & x(a) <= 1",
    "region r = rect(0, 0, 1, 1)",
    "require noOverlap()",
    'import "const A = task: (.spec"',
    "task: forall p, q in\n    block: leftOf(p, q)",
    "safe: x(mug) <=\n  workspace.right & leftOf(mug,\n  plate)",
    "last: exists i in 1..6: leftOf(block[i], block[i + 1])",
]
BROKEN = [
    "workspace [0 1] x [0, 1]",
    "object mug plate",
    "const A = * 3",
    "const A == 3",
    "def f(a = leftOf(a, b)",
    "region r rect(0, 0, 1, 1)",
    "require leftOf(mug,, plate)",
    "import foo",
    "task: forall p q in block: leftOf(p, q)",
    "safe: leftOf(mug, plate) && (mug]",
    "last: leftOf(mug plate)  # )",
    "next: leftOf(mug, (plate)",
    "then: closeTo(mug, plate, .25);",
]


def problems_of(text):
    with pytest.raises(SpecError) as refused:
        parse(Source("a.spec", text))
    return refused.value.diagnostics


@pytest.mark.long
@settings(max_examples=examples(150), deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.sampled_from(["", "\n", "# note: (\n"]), st.sampled_from(WHOLE + BROKEN)), min_size=1))
def test_one_diagnostic_for_each_broken_statement_and_none_for_the_others(parts):
    parts = parts[:MOST_ERRORS]
    text = "".join(f"{between}{statement}\n" for between, statement in parts)
    module, found = parse_tolerant(Source("a.spec", text))
    lines, line = [], 1
    for between, statement in parts:
        line += between.count("\n")
        lines.append(range(line, line + statement.count("\n") + 1))
        line += statement.count("\n") + 1
    broken = [number for number, (_, statement) in enumerate(parts) if statement in BROKEN]
    hit = [one.span.source.position(one.span.start)[0] for one in found]
    assert len(hit) == len(broken), text
    assert all(at in lines[number] for at, number in zip(hit, broken, strict=True)), text
    whole = "".join(f"{statement}\n" for _, statement in parts if statement in WHOLE)
    expected = print_module(parse(Source("whole.spec", whole))) if whole else ""
    assert (print_module(module) if module else "") == expected


@pytest.mark.long
@pytest.mark.parametrize("path", ERRORS, ids=lambda path: path.stem)
def test_both_parsers_say_the_same(path):
    source = Source(path.name, path.read_bytes().decode("utf-8", errors="replace"))
    module, found = parse_tolerant(source)
    try:
        strict = parse(source)
    except SpecError as refused:
        assert list(refused.diagnostics) == found
    else:
        assert found == [] and module == strict
    for one in module.statements if module else ():
        assert 0 <= one.start < one.end <= len(source.text)


@pytest.mark.long
@in_full_again
@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_a_shipped_spec_cut_off_anywhere(path):
    """What an editor sees while someone types: a diagnostic or a module at every length, the statements before kept."""
    text = path.read_text(encoding="utf-8")
    whole = parse(Source(path.name, text))
    for length in range(0, len(text), 13 if FULL else 97):
        module, found = parse_tolerant(Source(path.name, text[:length]))
        assert module is not None or found
        kept = module.statements if module else ()
        finished = [
            one for one, after in zip(whole.statements, whole.statements[1:], strict=False) if after.start < length
        ]
        assert len(kept) + 1 >= len(finished)
        assert kept[: len(finished) - 1] == tuple(finished[:-1])
        assert len(found) <= 1


SCRAPS = [
    *'()[]{}:;,.|&=#x\n"°∧\U0001f36d',
    "->",
    "forall ",
    "in ",
    "object ",
    "const A = ",
    "task: ",
    "workspace ",
    "25 cm",
]


@settings(max_examples=examples(120), deadline=None, derandomize=True)
@given(st.sampled_from(SPECS + ERRORS), st.randoms(use_true_random=False), st.integers(1, 5))
def test_damaged_texts_get_diagnostics_with_places_and_nothing_else(path, random, times):
    text = path.read_bytes().decode("utf-8", errors="replace")[:4000]
    for _ in range(times):
        at = random.randrange(len(text) + 1)
        text = text[:at] + random.choice(["", *SCRAPS]) + text[at + random.choice([0, 0, 1, 5]) :]
    module, found = parse_tolerant(Source("a.spec", text))
    assert module is not None or found
    for one in found:
        assert render(one) and json.dumps(to_json(one))
        assert one.span is None or 0 <= one.span.start <= one.span.end <= len(text)
    if not found:
        assert format_source(module.source)


def test_places_are_those_of_the_whole_text():
    text = "const A = = 1\n\nsafe: leftOf(mug, plate)\n"
    module, found = parse_tolerant(Source("a.spec", text))
    (safe,) = module.statements
    assert text[safe.start : safe.end] == "safe: leftOf(mug, plate)"
    assert found[0].span.source.text == text and found[0].span.place == "a.spec:1:11"


def test_a_statement_before_a_mistake_that_opens_a_line_is_kept():
    module, found = parse_tolerant(Source("a.spec", "object mug, plate\noops here\ntask: leftOf(mug, plate)\n"))
    assert len(found) == 1
    assert print_module(module) == "object mug, plate\ntask: leftOf(mug, plate)\n"


@pytest.mark.parametrize("text", ["", "  \n# nothing\n", "a\0b", "leftOf(a, ", "a\x0bb", "!" * 20_001 + "a"])
def test_where_nothing_parses_there_is_no_module(text):
    module, found = parse_tolerant(Source("a.spec", text))
    assert module is None and len(found) == 1


def test_a_bare_formula():
    module, found = parse_tolerant(Source("a.spec", "leftOf(a, b)"))
    assert module == parse(Source("a.spec", "leftOf(a, b)")) and found == []


def test_no_more_than_the_limit():
    assert len(problems_of("x: leftOf(a b)\n" * 50)) == MOST_ERRORS


@pytest.mark.long
@pytest.mark.parametrize("statement", ["x: leftOf(a b)\n", "x: (\n"])
def test_a_large_text_with_many_mistakes_takes_linear_time(statement):
    good = "".join(f"task{i}: leftOf(a, b) & closeTo(a, b)\n" for i in range(2000))
    began = time.process_time()
    parse(Source("a.spec", good))
    baseline = time.process_time() - began
    lines = good.splitlines(keepends=True)
    text = "".join(lines[:1990]) + statement * 30 + "".join(lines[1990:])
    began = time.process_time()
    assert len(problems_of(text)) == MOST_ERRORS
    assert time.process_time() - began < 3 * baseline + 10.0
