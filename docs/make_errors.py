"""Writes docs/errors.md: every diagnostic with what it means, an example and its mended text: `make errors`.

The data are those of `scenegen explain`, scenegen/errors/explanations. A test runs the examples, and holds the page to
what this script makes.
"""

from __future__ import annotations

from pathlib import Path

from scenegen.errors.catalog import GROUPS, CatalogEntry, catalog

PAGE = Path(__file__).resolve().parent / "errors.md"
INTRODUCTION = """# Errors and warnings

<!-- made by `make errors` from scenegen/errors: do not edit -->

Every error, warning and note has a code, as in `error[unknown-relation]`. Codes are stable: scripts may rely on them,
not on the texts. `scenegen explain CODE` prints what this page says.

The texts are made from facts, such as the unknown name and the nearest known one. `scenegen check --json` writes the
code and the `facts` of each diagnostic ([formats.md](formats.md#diagnostics-as-data)). The language server sends the
facts in `data`. Exceptions in Python have both: `error.diagnostics[0].code` and `.facts`. Below, the facts of each kind
are listed; not every diagnostic has all of them. Diagnostics of specs can also have `expansion`, `where` and `called`:
the definition or quantifier that the problem is in, the values of its variables, and the place that uses it.

Examples are specs, commands (`$`) or Python (`>>>`). Commands use `table.spec` and `two.spec`, specs of a mug and a
plate with the label `task` and, in the second, `safe`; and `scenes.json`, scenes of the first. In Python, `spec` and
`two` are these specs; `np` is numpy, `curriculum` is `scenegen.curriculum`, and `strategy` is from its `strategies`.
"""


def page() -> str:
    """The text of docs/errors.md."""
    entries = catalog().values()
    out = [INTRODUCTION]
    for group, title in GROUPS.items():
        out.append(f"## {title}\n")
        out += [_section(one) for one in entries if one.group == group]
    return "\n".join(out).rstrip() + "\n"


def _section(entry: CatalogEntry) -> str:
    severity = "" if entry.kind.severity == "error" else f" ({entry.kind.severity})"
    out = [f"### {entry.kind.code}\n", f"{entry.means}{severity}\n"]
    if entry.facts:
        out.append(f"Facts: {', '.join(f'`{name}`' for name in entry.facts)}\n")
    for name, text in (("example", entry.example), ("mended", entry.mended)):
        if text:
            shown = "".join(char if char == "\n" or char.isprintable() else f"\\u{ord(char):04x}" for char in text)
            out.append(f"{name.capitalize()}:\n\n```text\n{shown}\n```\n")
    return "\n".join(out)


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
    print(f"wrote {PAGE}")
