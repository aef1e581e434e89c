"""Texts with a cursor in them."""

from scenegen.editors.lsp.document import Document

CURSOR = "§"


def at_cursor(text, **options):
    """The document of a text without its cursor, and the cursor's offset."""
    offset = text.index(CURSOR)
    return Document(text.replace(CURSOR, ""), **options), offset
