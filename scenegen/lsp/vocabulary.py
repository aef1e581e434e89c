"""The purpose of keywords, functions and definitions, in one line each."""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from functools import cache, lru_cache

from scenegen.errors import Source, SpecError
from scenegen.lang import ast
from scenegen.lang.measure import SIGNATURES
from scenegen.lang.parse import parse
from scenegen.lang.print import print_expr
from scenegen.lang.scope import HEIGHTS, LIST_FUNCTIONS, signature_of, signatures
from scenegen.lang.tokens import scan
from scenegen.lsp.names import Binding
from scenegen.primitives import PRIMITIVES

KEYWORDS: Mapping[str, str] = {
    "workspace": "the table: workspace [0, 1] x [0, 1], in metres",
    "object": "what stands on the table: object mug, block[7] = box(5 cm, 5 cm, 5 cm), tray at (0.5, 0.5)",
    "region": "a named part of the table: region placemat = rect(0.3, 0, 0.7, 0.2)",
    "const": "a named number or point: const NEAR = 25 cm",
    "def": "a relation or function of one's own: def beside(a, b, e = 10 cm) = dist(a, b) <= e",
    "require": "what holds in every scene, and is not part of phi: require noOverlap()",
    "import": 'the statements of another file: import "table.spec"',
    "forall": "a formula for all: forall i in 1..6: leftOf(block[i], block[i + 1])",
    "exists": "a formula for at least one: exists p in block: closeTo(p, mug)",
    "in": "what a quantifier ranges over: a range, an array, a list, consecutive(list)",
    "at": "holds an object in place: object tray at (0.5, 0.5, 90 deg)",
    "and": "both: phi is the smaller of the two (also `&`)",
    "or": "one of them: phi is the larger of the two (also `|`)",
    "not": "the opposite: phi with the other sign (also `!`)",
    "implies": "if the left, then the right: phi is max(-left, right) (also `->`)",
    "true": "holds in every scene",
    "false": "holds in no scene",
}

CLAUSES: Mapping[str, str] = {
    "on": "what an object stands on: object mug on tray, book on shelfunit.shelf[2]",
    "of": 'another asset of an index in each scene: object mug of category("mug")',
    "any of": "one of several surfaces, all equally likely: object mug on any of [tray, workspace]",
    "by area": "surfaces are as likely as they are large: object mug on any of [tray, workspace] by area",
}

BUILT_IN: Mapping[str, str] = {
    "objects": "the list of all objects",
    "workspace": "the table as a region, with .left .right .top .bottom .center",
}

_COORDINATES = {
    "x": "the x coordinate of the centre, in metres, to the right",
    "y": "the y coordinate of the centre, in metres, away from the viewer",
    "theta": "the heading of an object, counter-clockwise from the x axis, in radians",
}

_SHAPES = {
    "box": "an upright box: its length along the heading, its width and height",
    "cylinder": "an upright cylinder",
    "prism": "an upright prism over a convex polygon",
    "urdf": "a robot description file; its outline is the hull of its collision shapes",
    "mesh": "a mesh file, .obj, .stl, .glb or .gltf in metres; its outline is its convex hull",
    "asset": 'an asset of the index assets.toml beside the spec, or of a folder\'s: "ycb/025_mug"',
    "category": "another asset of the index in each scene, of those that have the category",
    "cabinet": "a chest of drawers: how many, and by which share they are open: 0.6 is the top one, a list is one each",
    "rect": "a rectangle, by the coordinates of its sides",
    "circle": "a disc",
    "polygon": "a convex polygon, by its corners",
}

MEMBERS: Mapping[str, str] = {
    "left": "the middle of the left side",
    "right": "the middle of the right side",
    "top": "the middle of the far side",
    "bottom": "the middle of the near side",
    "center": "the centre",
    "topLeft": "the far left corner",
    "topRight": "the far right corner",
    "bottomLeft": "the near left corner",
    "bottomRight": "the near right corner",
    "corners": "the list of corners, counter-clockwise",
    "width": "the extent along x, of a surface across the object's heading, in metres",
    "height": "the extent along y, in metres",
    "length": "of a surface: the extent along the object's heading, in metres",
    "depth": "of a surface inside something: the free height over it, in metres",
    "first": "the first of a list",
    "last": "the last of a list",
    "count": "how many a list has",
}

UNITS: Mapping[str, str] = {
    "m": "metres",
    "cm": "centimetres",
    "mm": "millimetres",
    "rad": "radians",
    "deg": "degrees",
    "turn": "full turns",
}


@cache
def functions() -> Mapping[str, tuple[str, str]]:
    """Usage and meaning of every built-in function, including shapes of objects and regions."""
    table = {name: (signature.usage, _meaning(name)) for name, signature in signatures().items()}
    return table | {name: (SIGNATURES[name].usage, words) for name, words in _SHAPES.items()}


def _meaning(name: str) -> str:
    if name in _COORDINATES:
        return _COORDINATES[name]
    if name in HEIGHTS:
        return HEIGHTS[name]
    return LIST_FUNCTIONS[name] if name in LIST_FUNCTIONS else PRIMITIVES[name].doc


def remark(binding: Binding) -> str:
    """The comment that explains a declaration: behind it on its line, else on the lines right above it.

    The comment that opens a file is its title: it explains a definition at most.
    """
    text = binding.source.text
    end = text.find("\n", binding.closes)
    rest = text[binding.closes : len(text) if end < 0 else end]
    comment = next((token for token in scan(rest) if token.kind == "comment"), None)
    if comment is not None and not rest[: comment.start].strip(" \t,)"):
        return comment.text.lstrip("#").strip()
    start = text.rfind("\n", 0, binding.opens) + 1
    if text[start : binding.opens].strip() and binding.kind != "object":
        return ""
    above: list[str] = []
    while start > 0:
        before = text.rfind("\n", 0, start - 1) + 1
        line = text[before : start - 1].strip()
        if not line.startswith("#"):
            break
        above.insert(0, line.lstrip("#").strip())
        start = before
    if start == 0 and binding.kind != "definition":
        return ""
    return " ".join(above)


def notes(binding: Binding) -> tuple[str, str]:
    """The text beside a declaration in a list of completions: its usage or value, and its purpose."""
    if binding.kind == "definition":
        called, formula = usage(binding)
        return called, remark(binding) or formula
    written = " ".join(binding.source.text[binding.end : binding.closes].split()).lstrip("=: ")
    return (written[:60] if binding.kind in ("constant", "region") else ""), remark(binding)


def usage(definition: Binding) -> tuple[str, str]:
    """How a definition is called, and its formula; as far as its text can be parsed."""
    return _usage(definition.name, definition.source.text[definition.opens : definition.closes])


@lru_cache(maxsize=10_000)
def _usage(name: str, written: str) -> tuple[str, str]:
    """Cached by text, so definitions that do not change are not parsed again."""
    with contextlib.suppress(SpecError):
        for statement in parse(Source("<definition>", written)).statements:
            if isinstance(statement, ast.Definition):
                return signature_of(statement).usage, print_expr(statement.body)
    return f"{name}(...)", ""
