"""Positions of editors against what Python's own codecs say."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenegen.editors.lsp.answers import EncodedLines

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
