"""XML for simulators: elements, numbers that read back bit for bit, names that XML can hold."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.files import NO_WORLD, TOO_LARGE_TO_WRITE

Element = ElementTree.Element

MAX_DOCUMENT_BYTES = 1 << 29  # of memory for a file with many scenes


def node(parent: Element, tag: str, text: str | None = None, **attributes: str) -> Element:
    """A new last child of `parent`; a trailing underscore is for attributes that are keywords of Python."""
    child = ElementTree.SubElement(parent, tag, {name.rstrip("_"): value for name, value in attributes.items()})
    child.text = text
    return child


def numbers(*values: float) -> str:
    """The shortest digits that read back as the same floats, with spaces between."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)


def short(values: Iterable[float]) -> str:
    """Numbers with nine digits, enough for meshes and colours."""
    return " ".join(f"{value + 0.0:.9g}" for value in values)


def document(root: Element) -> bytes:
    """The bytes of a file, indented."""
    ElementTree.indent(root)
    data: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return data + b"\n"


def join_documents(root: Element, children: Iterable[Element]) -> bytes:
    """The bytes of a file like those of `document`, with `children` below the empty `root`. Children are written one
    after the other, so they may be one element that changes in between. Raises RequestError for more than MOST_BYTES,
    because all bytes are in memory, here and in the simulator."""
    mark = node(root, "mark")
    head, _, foot = document(root).partition(b"<mark />")
    root.remove(mark)
    parts = []
    size = 0
    for child in children:
        ElementTree.indent(child, level=1)
        parts.append(ElementTree.tostring(child, encoding="utf-8"))
        size += len(parts[-1])
        if size > MAX_DOCUMENT_BYTES:
            raise RequestError(_too_many(len(parts) - 1))
    return head + b"\n  ".join(parts) + foot


def check_room(scenes: int, size: int) -> None:
    """Refuse too many scenes in one file if each takes about `size` bytes of memory. Raises RequestError."""
    if scenes * size > MAX_DOCUMENT_BYTES:
        raise RequestError(_too_many(MAX_DOCUMENT_BYTES // size))


def _too_many(most: int) -> Diagnostic:
    return TOO_LARGE_TO_WRITE(most=most)


def check_names(names: Iterable[str]) -> None:
    """Refuse names with characters that XML cannot represent, and names that simulators reserve. Raises DataError."""
    for name in names:
        why = ""
        if not name or any(not _is_xml_character(ord(letter)) for letter in name):
            why = "cannot be written as a name in XML"
        elif name == "world" or "::" in name or (name.startswith("__") and name.endswith("__")):
            why = "is a name that simulators keep for themselves"
        if why:
            raise DataError(NO_WORLD(reason=why, name=ascii(name)))


def printable(text: str) -> str:
    """The text without characters that XML cannot represent."""
    return "".join(letter for letter in text if _is_xml_character(ord(letter)))


def _is_xml_character(code: int) -> bool:
    """Whether XML 1.0 allows a character; tabs and line breaks are excluded, because attributes do not preserve
    them."""
    return 0x20 <= code <= 0xD7FF or 0xE000 <= code <= 0xFFFD or 0x10000 <= code <= 0x10FFFF
