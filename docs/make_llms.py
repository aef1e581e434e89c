"""Writes docs/llms.txt: the whole reference on one page made for a prompt, `make llms`, part of `make derived`.

Relations and their meanings are those of the prelude, statements, operators and functions those of the tables in
docs/language.md and docs/time.md, objects those of the library. A test holds the page to what this script makes, and
checks its examples.
"""

from __future__ import annotations

import re
from pathlib import Path

from scenegen.lang.check.names import FILE_SHAPES
from scenegen.lang.check.regions import SIGNATURES
from scenegen.lang.check.scope import ARMS, HEIGHTS, LIST_FUNCTIONS, groups, prelude, signatures
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.printer import print_expr
from scenegen.things import ASSETS

DOCS = Path(__file__).resolve().parent
PAGE = DOCS / "llms.txt"

HEAD = """# scenegen: the language of .spec files

A spec describes table-top scenes. Coordinates are metres: x to the right, y away from the viewer; headings are
counter-clockwise from EAST. phi of a label is the margin by which a scene satisfies its formula: satisfied where
phi >= 0. `scenegen check FILE --json` tells what is wrong with a spec, `scenegen range FILE` how rare its scenes are.

## Example

```spec
object plate, mug, knife, block[3]
region placemat = rect(0.3, 0, 0.7, 0.2)
require noOverlap() & insideWorkspace()
task: inside(plate, placemat) & fullyRightOf(knife, plate) & angle(knife, NORTH, 15 deg)
near: closeTo(mug, plate, 30 cm) & !leftOf(mug, plate)
row: (forall p, q in consecutive(block): leftOf(p, q)) | (exists p in block: touching(p, mug))
```

Statements open with a keyword or `label:`; `#` starts a comment. Names of the library choose a shape; other objects
are blocks of 5 cm. A relation takes objects, regions or points `(x, y)`, except where `heading` or `items` (a list)
stands; name two different things. Lists: `[mug, plate]`, an array, `objects`. Lengths: `5 cm`, `0.05 m`; angles:
`20 deg`, `0.3 rad`, NORTH EAST SOUTH WEST. A length is never compared with an angle. Formulas have no `=` and no `==`:
write `alignedX(a, b)` or `abs(x(a) - x(b)) <= 1 cm`. Requirements hold in every scene; goals belong into labels.
"""
TIME = """
## Specs over time

```spec
time 20 steps
moves one
object mug, plate
require speed(mug) <= 20 cm/s
task: (initially leftOf(mug, plate)) & (finally rightOf(mug, plate)) & (always[0, 10] closeTo(mug, plate, 50 cm))
```

`time 20 steps` makes it a spec of motions with the moments 0 to 20. Windows `[a, b]` count steps from the moment at
which the formula stands; put what operators take in parentheses.
"""
SECTIONS = (
    ("Statements", "language.md", "statement"),
    ("Operators, loosest first", "language.md", "operator"),
    ("Functions", "language.md", "function"),
)
TIMED = (("operator", "Operators"), ("function", "Functions of a step"))


def rows(page: str, first: str) -> list[tuple[str, ...]]:
    """The cells of the rows of the first table of a page of docs/ whose first heading is `first`."""
    lines = (DOCS / page).read_text(encoding="utf-8").splitlines()
    start = next(place for place, line in enumerate(lines) if line.startswith(f"| {first} |"))
    found = []
    for line in lines[start + 2 :]:
        if not line.startswith("|"):
            break
        cells = re.split(r"(?<!\\)\|", line.strip().strip("|"))
        found.append(tuple(re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", cell.replace("\\|", "|")).strip() for cell in cells))
    return found


def table(page: str, first: str) -> list[str]:
    """A table as a list: what it is about, then the other cells."""
    return [f"- {one}: {'; '.join(cell for cell in rest if cell)}" for one, *rest in rows(page, first)]


def relations() -> list[str]:
    """Every definition of the prelude: usage, unit of defaults, and meaning, under its group."""
    out = []
    for group in groups():
        out.append(f"\n{group.title[0].upper()}{group.title[1:]}")
        out += [f"- {one.usage}: {one.meaning}" for one in group.entries]
    constants = [one for one in prelude().statements if isinstance(one, ast.Constant)]
    out.append("\nConstants: " + ", ".join(f"{one.name.id} = {print_expr(one.value)}" for one in constants) + ".")
    return out


def page() -> str:
    """The text of docs/llms.txt."""
    out = [HEAD, "## Relations", *relations()]
    for title, file, first in SECTIONS:
        out += [f"\n## {title}\n", *table(file, first)]
    words = {**HEIGHTS, **ARMS, **LIST_FUNCTIONS}
    out += [f"- `{signatures()[name].usage}`: {meaning}" for name, meaning in words.items()]
    elsewhere = (*FILE_SHAPES, "category", "arm")
    shapes = ", ".join(f"`{one.usage}`" for name, one in SIGNATURES.items() if name not in elsewhere)
    out.append(
        f"\n## Shapes, and surfaces to stand on\n\nOf objects (`= SHAPE`) and of regions (the last three): {shapes}."
    )
    out.append("Surfaces: " + "; ".join(f"{one}: {surfaces}" for one, surfaces in rows("language.md", "object")) + ".")
    out += [f"\n## Objects of the library\n\n{', '.join(ASSETS)}.", TIME]
    for first, title in TIMED:
        out += [f"{title}:", *table("time.md", first), ""]
    return "\n".join(out).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(f"wrote {PAGE}: {len(page()):,} characters; up to 15,000 or so fit a prompt well")
