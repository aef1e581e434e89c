"""Formatting is that of `scenegen fmt`, as one change."""

import pytest

from scenegen.editors.lsp.answers import formatted
from scenegen.editors.lsp.document import Document
from scenegen.lang.syntax.printer import format_source

MESSY = "# t\nobject mug,plate\n\n\n\nconst A=1 # one\ntask:leftOf(mug ,plate)\nsafe: leftOf(mug, plate)\n"


@pytest.mark.parametrize(
    "text", [MESSY, MESSY.rstrip(), MESSY + "\n\n", "  leftOf(a,b)", "a:leftOf(a ,b)\nb: leftOf(a, b)", "leftOf(a, b)"]
)
def test_the_change_makes_it_canonical(text):
    document = Document(text)
    change = formatted(document)
    assert text[: change.start] + change.text + text[change.end :] == format_source(document.source)


def test_lines_that_are_right_are_left_alone():
    change = formatted(Document("object a, b\nt:leftOf(a,b)\nu: leftOf(a, b)\n"))
    assert (change.text, change.start) == ("t: leftOf(a, b)\n", len("object a, b\n"))
    assert formatted(Document("object a, b\nt: leftOf(a, b)\n")) is None


def test_a_broken_text_is_left_alone():
    assert formatted(Document("task: leftOf(a,")) is None
