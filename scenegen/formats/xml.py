"""XML for simulators: elements, numbers that read back bit for bit, names that XML can hold."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree

from scenegen.errors import DataError, Diagnostic, RequestError

Element = ElementTree.Element

MOST_BYTES = 1 << 29  # of memory for a file with many scenes


def node(parent: Element, tag: str, text: str | None = None, **attributes: str) -> Element:
    """A new last child of `parent`; a trailing underscore keeps an attribute apart from a word of Python's."""
    child = ElementTree.SubElement(parent, tag, {name.rstrip("_"): value for name, value in attributes.items()})
    child.text = text
    return child


def numbers(*values: float) -> str:
    """The shortest digits that read back as the same floats, with spaces between."""
    return " ".join(repr(float(value) + 0.0).removesuffix(".0") for value in values)


def short(values: Iterable[float]) -> str:
    """Numbers to nine digits: what meshes and colours need."""
    return " ".join(f"{value + 0.0:.9g}" for value in values)


def document(root: Element) -> bytes:
    """The bytes of a file, indented."""
    ElementTree.indent(root)
    data: bytes = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True)
    return data + b"\n"


def gathered(root: Element, children: Iterable[Element]) -> bytes:
    """The bytes of a file as of `document`, with `children` below the empty `root`. One after the other is written out:
    all of them may be one element that has changed in between. Raises RequestError for more than MOST_BYTES: all are
    in memory at once, here and in the simulator."""
    mark = node(root, "mark")
    head, _, foot = document(root).partition(b"<mark />")
    root.remove(mark)
    parts = []
    size = 0
    for child in children:
        ElementTree.indent(child, level=1)
        parts.append(ElementTree.tostring(child, encoding="utf-8"))
        size += len(parts[-1])
        if size > MOST_BYTES:
            raise RequestError(_too_many(len(parts) - 1))
    return head + b"\n  ".join(parts) + foot


def check_room(scenes: int, size: int) -> None:
    """Refuse so many scenes in one file where each takes `size` bytes of memory, about. Raises RequestError."""
    if scenes * size > MOST_BYTES:
        raise RequestError(_too_many(MOST_BYTES // size))


def _too_many(most: int) -> Diagnostic:
    title = f"these scenes do not fit into one file, which is made in memory: the first {most:,} do"
    return Diagnostic(title, help="name a folder, which gets a file for each scene")


def check_names(names: Iterable[str]) -> None:
    """Refuse names with characters that XML has no way to write, and those that simulators keep for themselves. Raises
    DataError."""
    for name in names:
        why = ""
        if not name or any(not _allowed(ord(letter)) for letter in name):
            why = "cannot be written as a name in XML"
        elif name == "world" or "::" in name or (name.startswith("__") and name.endswith("__")):
            why = "is a name that simulators keep for themselves"
        if why:
            raise DataError(Diagnostic(f"an object's name {why}: {name!a}", help="rename it in the spec"))


def printable(text: str) -> str:
    """The text without characters that XML has no way to write."""
    return "".join(letter for letter in text if _allowed(ord(letter)))


def _allowed(code: int) -> bool:
    """Of XML 1.0's characters; tabs and line breaks would not survive in an attribute."""
    return 0x20 <= code <= 0xD7FF or 0xE000 <= code <= 0xFFFD or 0x10000 <= code <= 0x10FFFF
