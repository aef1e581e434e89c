"""Facts about the declarations of a spec: sizes, places, values; as far as the text has no errors."""

from __future__ import annotations

from scenegen.assets import ASSETS, Shape, shape_of
from scenegen.lang.spec import CheckedSpec
from scenegen.lsp.document import Document
from scenegen.lsp.names import Binding
from scenegen.primitives import Box, Circle, Footprint

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
