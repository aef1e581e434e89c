"""Bytes that are no spec, and the parser tables that stand in for the grammar."""

import json
from pathlib import Path

import lark
import pytest

from scenegen.errors import Source, SpecError
from scenegen.lang.checker import check_file, check_text
from scenegen.lang.syntax import parse as tables
from scenegen.lang.syntax.parse import Builder, _parser, parse, read_source

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
def test_the_finished_tables_are_those_of_the_grammar(timed):
    held = (ROOT / "grammar" / tables.TABLES[timed]).read_text(encoding="utf-8")
    assert held == tables.serialize(tables.grammar_text(timed)), "stale: run `make tables`"


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
            (tmp_path / tables.TABLES[False]).write_text(text, encoding="utf-8")
        tables._finished.cache_clear()
        _parser.cache_clear()
        monkeypatch.setattr(tables, "grammar_file", tmp_path.joinpath)
        return tables._finished(False)

    yield spoil
    monkeypatch.undo()
    tables._finished.cache_clear()
    _parser.cache_clear()


@pytest.mark.long
@pytest.mark.parametrize("kind", ["other fingerprint", "missing", "garbage", "not even an object", "no data"])
def test_tables_that_do_not_fit_are_passed_over(kind, stale):
    held = json.loads((ROOT / "grammar" / tables.TABLES[False]).read_text(encoding="utf-8"))
    spoilt = {
        "other fingerprint": json.dumps(held | {"fingerprint": "0" * 64}),
        "missing": None,
        "garbage": "{",
        "not even an object": "[]",
        "no data": "{}",
    }
    source = Source("a.spec", "task: !p -> [a, (1 cm, 2)][1].left\nsafe: forall i in 1..2: q")
    expected = dump(parse(source), places=True)
    assert tables._finished(False) is not None
    assert stale(spoilt[kind]) is None
    if kind == "missing":  # the same for all: the parser is built from the grammar, in seconds
        assert dump(parse(source), places=True) == expected


def test_a_changed_grammar_has_another_fingerprint():
    assert tables.fingerprint(GRAMMAR) != tables.fingerprint(GRAMMAR + "\n")
    assert tables.parser(Builder()) is not None
