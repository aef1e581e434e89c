"""Writes docs/relations.md and docs/images/relations/: every definition of the prelude with its meaning and a picture.

The meaning is the comment above the definition, the formula its body, and the pictures are the first two scenes of its
golden file (tests/golden/lang/relations). A test holds the page and the pictures to what this script makes: `make
relations`, which is part of `make derived`.
"""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

from scenegen.geometry.primitives import ANGLE, LENGTH
from scenegen.lang.check.scope import RelationEntry, defaults, groups, signature_of
from scenegen.lang.formula.core import Atom
from scenegen.lang.formula.interpret import deciding_atom, evaluate
from scenegen.lang.syntax.printer import print_expr
from scenegen.pictures.figures.dimensions import FigureObject, FigureScene, Guide, dimensions, short
from scenegen.pictures.figures.topview import topview

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "relations.md"
PICTURES = DOCS / "images" / "relations"
INTRODUCTION = """# Relations

<!-- made by `make derived` from grammar/prelude.spec and tests/golden/lang/relations: do not edit -->

The relations of [the prelude](../grammar/prelude.spec), which every spec can use: meaning, formula and two scenes each,
one that satisfies the relation and one that violates it. phi is the margin of the formula; phi >= 0 is satisfied. It is
in metres, for headings in radians times `ANGLE_SCALE`. In the pictures x is to the right and y away from the viewer; a
triangle marks the heading of an object; a square of the grid is 10 cm wide; the coloured line is what the active atom,
the one that gives phi its value, measures. [language.md](language.md) explains `dist`, `gap`, `room`, `reach` and
`bearing`.

Arguments are objects, regions or points, except where a heading or a list is named; `(x, y)` and `placemat.left` are
points.
"""


def load_scenes() -> ModuleType:
    """The reader of the golden files, which lives with the tests."""
    path = DOCS.parent / "tests" / "lang" / "relation_scenes.py"
    spec = importlib.util.spec_from_file_location("relation_scenes", path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


def unit(entry: RelationEntry, scenes: Any) -> str:
    """What phi is measured in."""
    core = scenes[0].spec().core
    units = {node.unit for node in core.nodes if isinstance(node, Atom)}
    names = [name for one, name in ((LENGTH, "m"), (ANGLE, "rad · `ANGLE_SCALE`")) if one in units]
    return " and ".join(names)


def view(entry: RelationEntry, scene: Any) -> FigureScene:
    """A golden scene with what its deciding atom measures."""
    spec = scene.spec()
    values = evaluate(spec.core, scene.rows)
    marks = dimensions(spec.core, deciding_atom(spec.core, "task", values), scene.rows)
    if any(one.name.id == "through" for one in entry.definition.parameters):
        marks.insert(0, Guide((0.5, 0.0), (0.5, 1.0)))  # the mirror of the default
    zones = [FigureObject(one.name, one.footprint, one.pose, zone=True) for one in spec.regions]
    things = [
        FigureObject(name, shape.footprint, pose)
        for name, shape, pose in zip(spec.objects, spec.shapes, scene.poses, strict=True)
    ]
    phi = short(scene.phi)
    if scene.task.endswith(" >= 0"):  # a number or a point, not a formula
        return FigureScene([*zones, *things], marks=marks, caption=[f"{scene.task.removesuffix(' >= 0')} = {phi}"])
    caption = [scene.task, f"phi = {phi}"]
    return FigureScene([*zones, *things], marks=marks, caption=caption, good=scene.phi >= 0.0)


def files() -> dict[Path, str]:
    """Every file that this script writes, with its text. Raises FileNotFoundError for a definition without a golden."""
    scenes = load_scenes()
    written: dict[Path, str] = {}
    body: list[str] = []
    index: list[str] = []
    for group in groups():
        heading, _, note = (group.title[0].upper() + group.title[1:]).partition(". ")
        body += [f"\n## {heading}\n", *([f"{note}\n"] if note else [])]
        index.append(
            f"* {heading.split(':')[0]}: " + ", ".join(f"[{one.name}](#{one.name.lower()})" for one in group.entries)
        )
        for entry in group.entries:
            words, golden = scenes.read(scenes.FOLDER / f"{entry.name}.txt")
            picture = PICTURES / f"{entry.name}.svg"
            written[picture] = topview(*(view(entry, scene) for scene in golden[:2]))
            body += page_entry(entry, words, golden)
    written[PAGE] = INTRODUCTION + "\n" + "\n".join(index) + "\n" + "\n".join(body)
    return written


def page_entry(entry: RelationEntry, words: str, golden: Any) -> list[str]:
    standard = ", ".join(f"`{name}` = {value}" for name, value in defaults(entry.definition).items())
    formula = golden[1].phi < 0.0
    shown = "a scene that satisfies it and one that violates it" if formula else "two scenes with its value"
    return [
        f"### {entry.name}\n",
        f"`{signature_of(entry.definition).usage}`\n",
        f"{entry.meaning}\n",
        f"* formula: `{print_expr(entry.definition.body)}`",
        f"* {re.sub(r' [*] ', ' · ', words)}",
        f"* unit: {unit(entry, golden)}",
        *([f"* defaults: {standard}"] if standard else []),
        f"\n![{entry.name}: {shown}](images/relations/{entry.name}.svg)\n",
    ]


def main() -> None:
    written = files()
    PICTURES.mkdir(parents=True, exist_ok=True)
    for path in set(PICTURES.glob("*.svg")) - set(written):
        path.unlink()
    for path, text in written.items():
        path.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
