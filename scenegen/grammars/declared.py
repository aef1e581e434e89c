"""The part of a spec that an answer continues: its declarations, without its labels."""

from __future__ import annotations

import re

from scenegen.errors import Source
from scenegen.lang import ast, traversal
from scenegen.lang.parse import parse
from scenegen.lang.print import print_statement

BASES = ("goal", "aim", "target")  # what labels are called, whichever is free


def declarations(text: str, objects: tuple[str, ...]) -> str:
    """The statements of a canonical text but its labels, one after the other, ending in a line break. Labels that other
    statements use stay; `objects` are declared where the text leaves them to be inferred."""
    module = parse(Source("<spec>", text))
    labels = {one.name.id: one for one in module.statements if isinstance(one, ast.Label)}
    rest = [one for one in module.statements if not isinstance(one, ast.Label)]
    kept: set[str] = set()
    waiting: list[ast.Statement] = list(rest)
    while waiting:
        used = _names(waiting.pop()) & labels.keys() - kept
        kept |= used
        waiting += [labels[name] for name in used]
    lines = [print_statement(one) for one in module.statements if not isinstance(one, ast.Label) or one.name.id in kept]
    if not any(isinstance(one, ast.Objects) for one in rest):
        lines.insert(0, f"object {', '.join(objects)}")
    return "".join(line + "\n" for line in lines)


def label_names(text: str, count: int) -> tuple[str, ...]:
    """Names for so many labels that occur nowhere in the text."""
    words = set(re.findall(r"\w+", text))
    number = 0
    while True:
        for base in BASES if not number else (f"goal_{number}_",):
            names = tuple(f"{base}{place}" for place in range(1, count + 1))
            if not words & set(names):
                return names
        number += 1


def _names(statement: ast.Statement) -> set[str]:
    """All names that the expressions of a statement mention."""
    found: set[str] = set()
    stack: list[ast.Expr | ast.Argument] = list(traversal.expressions(statement))
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Name):
            found.add(node.id)
        stack.extend(traversal.children(node))
    return found
