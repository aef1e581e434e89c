"""Every mistake a spec can hold and what the user reads about it: golden/lang/errors/NAME.spec beside NAME.txt."""

import functools
import re
from pathlib import Path

import pytest

from scenegen.errors import SpecError
from scenegen.lang.checker import check
from scenegen.lang.syntax.parse import read_source

ROOT = Path(__file__).resolve().parents[2]
FOLDER = ROOT / "tests" / "golden" / "lang" / "errors"
SPECS = sorted(FOLDER.glob("*.spec"))


@functools.cache
def diagnostics(path):
    with pytest.raises(SpecError) as refused:
        check(read_source(path.name, path.read_bytes()))
    return refused.value


@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_the_message(path, golden):
    golden(f"lang/errors/{path.stem}.txt", f"{diagnostics(path)}\n")


def test_no_expectation_is_left_over():
    assert {path.stem for path in FOLDER.glob("*.txt")} == {path.stem for path in SPECS}
    assert len(SPECS) >= 60


def test_every_message_has_a_place_inside_the_text_and_says_something_beside_its_title():
    for path in SPECS:
        for one in diagnostics(path).diagnostics:
            assert one.span is not None, path.stem
            assert 0 <= one.span.start <= one.span.end <= len(one.span.source.text), path.stem
            assert one.span.source.name == path.name, path.stem


def test_no_name_of_the_grammar_gets_out():
    grammar = (ROOT / "grammar" / "spec.lark").read_text(encoding="utf-8")
    terminals = set(re.findall(r"^(_?[A-Z]+)(?:\.\d+)?:", grammar, re.MULTILINE)) - {"X"}
    assert {"NAME", "_AND", "QUANTITY", "LABEL"} <= terminals
    names = terminals | {"RPAR", "LPAR", "RSQB", "LSQB", "EQUAL", "COLON", "COMMA", "$END", "__ANON_0", "ladder"}
    for path in SPECS:
        own = set(re.findall(r"\w+", path.read_text(encoding="utf-8")))
        for one in diagnostics(path).diagnostics:
            said = set(re.findall(r"[$\w]+", f"{one.title} {one.label} {one.help} {one.note}"))
            assert not (said & names) - own, path.stem
