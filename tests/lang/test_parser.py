"""Bytes that are no spec, and the parser tables that stand in for the grammar. Several syntax errors from one run:
every broken statement is reported once, whole ones never are. Formulas that are very deep, very long or very large:
all the way through, or refused; never a RecursionError.
"""

import functools
import json
import time
from pathlib import Path

import lark
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.errors import Source, SpecError, render, to_json
from scenegen.lang.checker import check_file, check_text
from scenegen.lang.formula import builder
from scenegen.lang.formula.interpret import phi
from scenegen.lang.syntax import parse as parse_depth
from scenegen.lang.syntax import parse as tables
from scenegen.lang.syntax.parse import MOST_ERRORS, Builder, _parser, parse, parse_tolerant, read_source
from scenegen.lang.syntax.printer import format_source, print_module
from scenegen.learn.robustness import Robustness

from ..laws import FULL, examples, in_full_again
from .trees import dump

ROOT = Path(__file__).resolve().parents[2]
TEXT = "leftOf(mug, plate) & !closeTo(mug, plate, 0.25)"
GRAMMAR = (ROOT / "grammar" / "spec.lark").read_text(encoding="utf-8")

BAD_BYTES = {
    "zeros": b"leftOf(a, b)\0",
    "an ELF file": b"\x7fELF\x02\x01\x01\0\0\0",
    "a PNG file": b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR",
    "random bytes": bytes(range(128, 256)),
    "Latin-1": "# Stück für Stück\nleftOf(a, b)".encode("latin-1"),
    "UTF-16 with a mark": TEXT.encode("utf-16"),
    "UTF-16 big-endian, with a mark": b"\xfe\xff" + TEXT.encode("utf-16-be"),
    "UTF-16 without a mark": TEXT.encode("utf-16-le"),
    "UTF-32": TEXT.encode("utf-32"),
    "half a character": TEXT.encode() + b"\n# \xe2\x88",
    "a surrogate": b"# \xed\xa0\x80\nleftOf(a, b)",
    "zeros far in": b"#" * 10_000 + b"\0",
    "nothing": b"",
    "white space": b" \n\t\r\n",
    "a mark alone": b"\xef\xbb\xbf",
}


def test_what_is_not_text(golden):
    told = []
    for name, data in BAD_BYTES.items():
        with pytest.raises(SpecError) as refused:
            check_file(Path("bad.spec"), data)
        assert len(refused.value.diagnostics) == 1
        told.append(f"> {name}\n{refused.value}\n")
    golden("lang/not_text.txt", "\n".join(told))


@pytest.mark.parametrize("data", [b"\xef\xbb\xbf" + TEXT.encode(), TEXT.replace(" ", "\r\n").encode()])
def test_a_byte_order_mark_and_other_line_ends_are_fine(data):
    assert check_text(read_source("a.spec", data).text).source == TEXT + "\n"


@pytest.mark.long
def test_the_grammar_is_free_of_conflicts():
    """strict: Lark proves that no two actions of the parser and no two terminals collide."""
    pytest.importorskip("interegular")
    for timed in (False, True):
        tables.build(tables.grammar_text(timed), strict=True)
    with pytest.raises(lark.exceptions.GrammarError):
        tables.build('start: a | b\na: "x"\nb: "x"\n', strict=True)


@pytest.mark.long
@pytest.mark.parametrize("timed", [False, True])
def test_the_read_tables_tables_are_those_of_the_grammar(timed, derived):
    derived(f"grammar/{tables.PARSER_TABLES[timed]}", tables.serialize(tables.grammar_text(timed)))


def test_what_the_grammar_has_of_time():
    """Nothing of it counts without time, and nothing that it replaces counts with it."""
    still, timed = tables.grammar_text(False), tables.grammar_text(True)
    assert "until" in timed and "untimed" not in timed.split("?ladder")[1] and "//time" not in timed.split("start:")[1]
    for name in ("OVER_TIME", "UNTIL", "EVERY", "MOVES"):
        assert not [line for line in still.splitlines() if name in line and not line.startswith("//")]


@pytest.fixture
def stale(tmp_path, monkeypatch):
    """grammar/ in a copy whose tables can be spoilt."""

    def spoil(text):
        (tmp_path / "spec.lark").write_text(GRAMMAR, encoding="utf-8")
        if text is not None:
            (tmp_path / tables.PARSER_TABLES[False]).write_text(text, encoding="utf-8")
        tables._read_tables.cache_clear()
        _parser.cache_clear()
        monkeypatch.setattr(tables, "grammar_file", tmp_path.joinpath)
        return tables._read_tables(False)

    yield spoil
    monkeypatch.undo()
    tables._read_tables.cache_clear()
    _parser.cache_clear()


@pytest.mark.long
@pytest.mark.parametrize("kind", ["other fingerprint", "missing", "garbage", "not even an object", "no data"])
def test_tables_that_do_not_fit_are_passed_over(kind, stale):
    held = json.loads((ROOT / "grammar" / tables.PARSER_TABLES[False]).read_text(encoding="utf-8"))
    spoilt = {
        "other fingerprint": json.dumps(held | {"fingerprint": "0" * 64}),
        "missing": None,
        "garbage": "{",
        "not even an object": "[]",
        "no data": "{}",
    }
    source = Source("a.spec", "task: !p -> [a, (1 cm, 2)][1].left\nsafe: forall i in 1..2: q")
    expected = dump(parse(source), places=True)
    assert tables._read_tables(False) is not None
    assert stale(spoilt[kind]) is None
    if kind == "missing":  # the same for all: the parser is built from the grammar, in seconds
        assert dump(parse(source), places=True) == expected


def test_a_changed_grammar_has_another_fingerprint():
    assert tables.fingerprint(GRAMMAR) != tables.fingerprint(GRAMMAR + "\n")
    assert tables.parser(Builder()) is not None


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


N = 10_000
FEW = 1_200  # Python's recursion ends at 1,000
BAR = 4.0 * 5.0  # seconds: the bar, and room for a busy machine


def through(n):
    """name -> formula of depth, length or size n; all in range of the limits for n = N."""
    return {
        "parentheses": "(" * n + "leftOf(a, b)" + ")" * n,
        "parentheses around a number": "(" * n + "x(a)" + ")" * n + " <= 1",
        "negations": "!" * n + "leftOf(a, b)",
        "an odd number of negations": "not " * (n + 1) + "leftOf(a, b)",
        "one atom often": " & ".join(["leftOf(a, b)"] * n),
        "flat conjunction": " & ".join(f"leftOf(o{i}, o{i + 1})" for i in range(n)),
        "one tolerance each": " & ".join(f"closeTo(a, b, {i + 1} mm)" for i in range(n)),
        "sum, nested to the left": "(" * n + "x(a)" + " + y(b))" * n + " <= 1",
        "difference, nested to the right": "(x(a) - " * n + "y(b)" + ")" * n + " <= 1",
        "unary minus": "-" * n + "x(a) <= 1",
        "calls": "abs(" * (n - 2) + "x(a)" + ")" * (n - 2) + " <= 1",
        "and and or in turn": "(leftOf(a, b) | (leftOf(b, c) & " * (n // 2) + "leftOf(c, a)" + "))" * (n // 2),
        "implications to the left": "(" * n + "leftOf(a, b)" + " -> leftOf(b, c))" * n,
        "a long comparison": " <= ".join(f"x(o{i})" for i in range(n)),
    }


THROUGH = through(1)
SIZES = [FEW, pytest.param(N, marks=pytest.mark.slow)]

REFUSED = {
    "calls": "abs(" * N + "x(a)" + ")" * N + " <= 1",
    "negated conjunctions": "!(leftOf(a, b) & " * N + "leftOf(c, a)" + ")" * N,
    "too many negations": "!" * 20_001 + "leftOf(a, b)",
    "lists": "[" * N + "a" + "]" * N,
    "indices": "a" + "[1]" * N,
    "members": "a" + ".b" * N,
    "quantifiers": "forall p in a: " * N + "p",
    "brackets that never close": "(" * N,
    "brackets that were never opened": "a" + ")" * N,
    "a missing operator": "(" * N + "a b" + ")" * N,
}


@functools.cache
def checked(name, n=FEW):
    return check_text(through(n)[name])


@pytest.mark.long
@pytest.mark.parametrize("n", SIZES)
@pytest.mark.parametrize("name", THROUGH)
def test_all_the_way_through(name, n):
    began = time.process_time()
    spec = checked(name, n)
    generator = torch.Generator().manual_seed(0)
    poses = torch.rand(1, len(spec.objects), 3, dtype=torch.float64, generator=generator)
    value = Robustness(spec.core)(poses)
    assert time.process_time() - began < BAR
    expected = phi(spec.core, poses.reshape(-1).tolist())["task"]
    assert value.shape == (1, 1) and float(value) == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.long
def test_what_the_deep_ones_are_worth():
    def worth(name, *poses):
        spec = checked(name)
        rows = dict(zip(spec.objects, poses, strict=True))
        return phi(spec.core, [value for one in spec.objects for value in rows[one]])["task"]

    a, b = (0.25, 0.5, 0.0), (0.75, 0.125, 0.0)
    assert worth("parentheses", a, b) == worth("negations", a, b) == worth("one atom often", a, b) == 0.5
    assert worth("an odd number of negations", a, b) == -0.5
    assert worth("sum, nested to the left", a, b) == 1 - (0.25 + FEW * 0.125)
    assert worth("difference, nested to the right", a, b) == 1 - 0.125  # x - (x - (... - y)), FEW even
    assert worth("unary minus", a) == 1 - 0.25


@pytest.mark.long
@pytest.mark.parametrize("name", ["flat conjunction", "negations"])
def test_the_canonical_text_of_the_deep_means_the_same(name):
    spec = checked(name)
    again = check_text(spec.source)
    assert again.source == spec.source and len(again.core.nodes) == len(spec.core.nodes)


@pytest.mark.long
@pytest.mark.parametrize("name", REFUSED)
def test_refused_with_a_diagnostic(name):
    began = time.process_time()
    with pytest.raises(SpecError) as refused:
        check_text(REFUSED[name])
    assert time.process_time() - began < BAR
    problem = refused.value.diagnostics[0]
    assert problem.title and problem.span is not None
    assert len(refused.value.diagnostics) <= MOST_ERRORS
    assert len(render(problem)) < 1000, "however long the line, the message is short"


@pytest.mark.long
def test_the_nesting_limit_is_said(golden):
    with pytest.raises(SpecError) as refused:
        check_text("!" * (parse_depth.MAX_NESTING + 1) + "leftOf(a, b)")
    golden("lang/too_deep.txt", f"{refused.value}\n")
    check_text("!" * (parse_depth.MAX_NESTING - 3) + "leftOf(a, b)")


def test_too_many_characters(monkeypatch):
    monkeypatch.setattr(parse_depth, "MAX_CHARACTERS", 30)
    check_text("leftOf(a, b)".ljust(30))
    with pytest.raises(SpecError, match=r"long.spec is too long: 31 characters; the limit is 30"):
        parse_depth.parse(Source("long.spec", "leftOf(a, b)".ljust(31)))


def test_definitions_that_double_at_every_level(monkeypatch):
    monkeypatch.setattr(builder, "MAX_NODES", 5_000)
    steps = "".join(f"def f{i + 1}(a) = f{i}(a + {2**i}) & f{i}(a - {2**i})\n" for i in range(40))
    with pytest.raises(SpecError, match=r"expands to more than [\d,]+ parts"):
        check_text(f"def f0(a) = x(m) <= a\n{steps}task: f40(0)")


@pytest.mark.long
def test_definitions_that_call_each_other_a_thousand_deep():
    steps = "".join(f"def f{i + 1}(a) = f{i}(a) | closeTo(a, b, {i + 1} mm)\n" for i in range(1000))
    spec = check_text(f"def f0(a) = leftOf(a, b)\n{steps}task: f1000(m)")
    # b is named first; x(b) - x(m) = -0.5, and closeTo is worth most at 1000 mm: 1 - 0.5
    assert phi(spec.core, [0.0, 0.0, 0.0, 0.5, 0.0, 0.0])["task"] == 0.5
