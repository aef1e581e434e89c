"""Where names are declared and used: go to definition, the outline of a file, renaming."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from scenegen.editors.lsp.document import Document, prelude_index
from scenegen.editors.lsp.names import Binding, Kind, Occurrence, functions
from scenegen.errors import ScenegenError, Span
from scenegen.geometry import Box, Circle, Footprint
from scenegen.lang.check.scope import BUILT_IN
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax.tokens import KEYWORDS
from scenegen.things import ASSETS, Shape, shape_of


@dataclass(frozen=True, slots=True)
class SourceLocation:
    """Characters of a file; `path` and `text` are None for the open document itself."""

    path: Path | None
    text: str | None
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class Symbol:
    """A declaration: its name at start..end, all of it at opens..closes, and what its line says."""

    name: str
    kind: Kind
    detail: str
    start: int
    end: int
    opens: int
    closes: int


def definition(document: Document, offset: int) -> SourceLocation | None:
    """Where the name at an offset is declared, or the beginning of the file that an `import` names."""
    found = document.occurrence(offset)
    if found is None:
        return None
    if found.role == "import":
        try:
            path = document.project().find(found.name, Span(document.source, found.start, found.end))
        except ScenegenError:
            return None
        return SourceLocation(path, "", 0, 0) if path.is_file() else None
    binding = document.meaning(found)
    if binding is None:
        return None
    if binding.source is document.source:
        return SourceLocation(None, None, binding.start, binding.end)
    return SourceLocation(binding.path, binding.source.text, binding.start, binding.end)


def symbols(document: Document) -> list[Symbol]:
    """What the file declares, in the order of the text."""
    found = []
    for one in document.index.declarations:
        detail = " ".join(document.text[one.end : one.closes].split()).lstrip("=: ")
        found.append(Symbol(one.name, one.kind, detail[:60], one.start, one.end, one.opens, max(one.end, one.closes)))
    return found


def uses(document: Document, offset: int) -> list[Occurrence]:
    """Every place of this file where the name at an offset has the same meaning; empty if it is declared in another
    file, built in, or unknown."""
    found = document.occurrence(offset)
    binding = document.meaning(found) if found is not None else None
    if binding is None or binding.source is not document.source:
        return []
    same = [one for one in document.index.occurrences if one.name == binding.name]
    return [one for one in same if document.meaning(one) is binding]


def refusal(document: Document, offset: int, name: str) -> str:
    """Why the name at an offset cannot become `name`; "" if it can."""
    places = uses(document, offset)
    if not places:
        return "only names that this file declares can be renamed"
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name):
        return "names are made of the letters a-z and A-Z, digits and `_`"
    if name in KEYWORDS or name in BUILT_IN:
        return f"`{name}` is a word of the language"
    binding = document.meaning(places[0])
    assert binding is not None
    if binding.kind == "definition":
        taken = name in document.functions or name in functions()
    elif binding.kind in ("parameter", "variable"):
        taken = _is_in_reach(document, binding, name) or name in document.values
    else:
        prelude = {one.name for one in prelude_index().declarations}
        locals_ = {reach.binding.name for reach in document.index.reaches}
        taken = (name in document.values and not (binding.kind == "constant" and name in prelude)) or name in locals_
    return f"`{name}` means something else already" if taken else ""


def _is_in_reach(document: Document, binding: Binding, name: str) -> bool:
    """Whether a parameter or variable of that name can be used where this one can."""
    reaches = document.index.reaches
    own = [one for one in reaches if one.binding is binding]
    others = [one for one in reaches if one.binding.name == name]
    return any(one.start < mine.end and mine.start < one.end for one in others for mine in own)


# --------------------------------------------------------------------------------------------------------------------
# Facts about the declarations of a spec: sizes, places, values; as far as the text has no errors.


SHOWN = 12  # names that a list of objects shows


def _spec(document: Document) -> CheckedSpec | None:
    return document.salvaged[1] if document.salvaged is not None else None


def size(footprint: Footprint) -> str:
    """A footprint in words."""
    match footprint:
        case Circle(radius):
            return f"circle of radius {_metres(radius)}"
        case Box(length, width):
            return f"box {_metres(length)} x {_metres(width)}"
        case _:
            return f"convex polygon of {len(footprint.vertices)} corners"


def _metres(length: float) -> str:
    return f"{length:.4g} m" if length >= 1.0 else f"{100.0 * length:.4g} cm"


def _shape(shape: Shape) -> str:
    return f"{shape.asset}: {size(shape.footprint)}, {_metres(shape.height)} high"


def asset(name: str) -> str:
    """The size of an entry of the library."""
    return _shape(shape_of(name)) if name in ASSETS else ""


def thing(document: Document, binding: Binding) -> str:
    """Shape, number and place of an object or array."""
    spec = _spec(document)
    name = f"{binding.name}[1]" if binding.is_array else binding.name
    kind = None if spec is None else next((one for one in spec.counts if one.assets and one.name == name), None)
    if kind is not None:
        return f"one of the assets {', '.join(kind.assets)}"
    if spec is None or name not in spec.objects:
        written = " ".join(binding.source.text[binding.end : binding.closes].split())
        return f"`{binding.name}{' ' if written[:1] not in ('', '[') else ''}{written}`"
    index = spec.objects.index(name)
    words = _shape(spec.shapes[index])
    if binding.is_array:
        count = sum(one.startswith(f"{binding.name}[") for one in spec.objects)
        drawn = next((one for one in spec.counts if one.name == binding.name), None)
        return f"{count if drawn is None else f'{drawn.least} to {drawn.most}'} of {words}"
    if index in spec.fixed:
        x, y, theta = spec.fixed[index]
        return f"{words}; held at ({x:.4g}, {y:.4g}), heading {theta:.4g} rad"
    return words


def region(document: Document, name: str) -> list[str]:
    """Shape and centre of a region."""
    spec = _spec(document)
    found = next((one for one in spec.regions if one.name == name), None) if spec is not None else None
    if found is None:
        return []
    x, y, _ = found.pose
    return [f"**region** {size(found.footprint)}, centre ({x:.4g}, {y:.4g})"]


def workspace(document: Document) -> str:
    """The extent of the table."""
    spec = _spec(document)
    if spec is None:
        return ""
    (left, right), (bottom, top) = spec.workspace.x, spec.workspace.y
    return f"[{left:g}, {right:g}] x [{bottom:g}, {top:g}] m"


def objects(document: Document) -> str:
    """The names of all objects."""
    spec = _spec(document)
    if spec is None:
        return ""
    more = f", ... ({len(spec.objects)} in all)" if len(spec.objects) > SHOWN else ""
    return ", ".join(f"`{one}`" for one in spec.objects[:SHOWN]) + more
