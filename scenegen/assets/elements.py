"""XML from strangers: elements with their attributes, lines and short texts, nothing else.

Document types are refused, and with them entities; size, depth and number of elements are limited.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.parsers import expat

MOST_BYTES = 8_000_000
MOST_ELEMENTS = 20_000
DEEPEST = 50
LONGEST = 200  # characters of text that are kept of an element


class ElementsError(Exception):
    """The text is not read; the message says why."""


@dataclass(slots=True)
class Element:
    """`<tag name="value">` with its children in order; `line` counts from 1."""

    tag: str
    attributes: dict[str, str]
    line: int
    children: list[Element] = field(default_factory=list)
    text: str = ""  # before its first child, the first characters of it

    @property
    def place(self) -> str:
        return f"line {self.line}, <{self.tag}>"

    def all(self, tag: str) -> list[Element]:
        """The children of that tag."""
        return [child for child in self.children if child.tag == tag]

    def one(self, tag: str) -> Element:
        """The first child of that tag. Raises ElementsError where there is none."""
        found = self.all(tag)
        if not found:
            raise ElementsError(f"{self.place}: there is no <{tag}> in it")
        return found[0]

    def get(self, name: str, default: str = "") -> str:
        """An attribute. Raises ElementsError where it is missing and has no default."""
        value = self.attributes.get(name, default)
        if not value:
            raise ElementsError(f"{self.place}: it has no {name}")
        return value


def elements(data: bytes) -> Element:
    """The outermost element of an XML document. Raises ElementsError."""
    if len(data) > MOST_BYTES:
        raise ElementsError(f"it is larger than {MOST_BYTES:,} bytes")
    parser = expat.ParserCreate()
    document = Element("", {}, 0)
    path = [document]
    count = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count
        line = parser.CurrentLineNumber
        count += 1
        if tag.startswith("xacro:"):
            raise ElementsError(f"line {line}: it is a xacro file; expand it first: xacro in.xacro > out.urdf")
        if count > MOST_ELEMENTS:
            raise ElementsError(f"it has more than {MOST_ELEMENTS:,} elements")
        if len(path) > DEEPEST:
            raise ElementsError(f"line {line}: it is nested more than {DEEPEST} deep")
        element = Element(tag, attributes, line)
        path[-1].children.append(element)
        path.append(element)

    def end(tag: str) -> None:
        path.pop()

    def doctype(*_: object) -> None:
        raise ElementsError(f"line {parser.CurrentLineNumber}: it has a document type, which is not read; remove it")

    def characters(text: str) -> None:
        here = path[-1]
        if not here.children and len(here.text) < LONGEST:
            here.text += text[:LONGEST]

    parser.buffer_text = True
    parser.CharacterDataHandler = characters
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = doctype
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise ElementsError(
            f"it is not well-formed XML at line {error.lineno}: {expat.ErrorString(error.code)}"
        ) from None
    except (LookupError, ValueError):  # of the codecs, for an encoding that expat does not know itself
        raise ElementsError("it is not well-formed XML: its encoding is unknown") from None
    return document.children[0]
