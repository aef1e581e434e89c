"""Reads tests/golden/lang/relations: scenes for each relation of the prelude, with phi worked out on paper.

A file opens with what phi is in words. A scene opens with `== title`; a spec of one label `task` follows, in which
`at` says where each object stands in this scene (x and y in metres, heading in degrees). What follows the task is
arithmetic, `name = expression = ... = number`, the last of them `phi`. All sides of an equation must agree, so a slip
of the pen shows before any relation is computed. Nothing ever writes these files. docs/make_relations.py draws the
first two scenes of each.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from scenegen.lang.checker import check_text
from scenegen.lang.spec import CheckedSpec

FOLDER = Path(__file__).resolve().parents[1] / "golden" / "lang" / "relations"
SLIP = 1e-12

_AT = re.compile(r"^((?:object|robot) (\w+).*?)\s+at \(([^()]*)\)$")
_FUNCTIONS = {"sqrt": math.sqrt, "abs": abs, "min": min, "max": max}
_OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.truediv}


@dataclass(frozen=True)
class Scene:
    """One scene of a golden file: the spec with its objects free, where they stand, and phi by hand."""

    title: str
    text: str
    poses: tuple[tuple[float, float, float], ...]
    working: tuple[str, ...]

    @property
    def task(self) -> str:
        """The formula, as written."""
        (line,) = re.findall(r"^task: (.*)$", self.text, re.MULTILINE)
        return line

    @property
    def rows(self) -> list[float]:
        """3N coordinates."""
        return [number for pose in self.poses for number in pose]

    @property
    def phi(self) -> float:
        return work_out(self.working)["phi"]

    def spec(self) -> CheckedSpec:
        return _checked(self.text)

    def held(self) -> CheckedSpec:
        """The same with all objects but the first held in place."""
        spec, lines = self.spec(), []
        places = dict(zip(spec.objects, self.poses, strict=True))
        for line in self.text.splitlines():
            name = line.split()[1] if line.startswith("object ") else ""
            if name and name != spec.objects[0]:
                x, y, theta = places[name]
                line += f" at ({x!r}, {y!r}, {theta!r})"
            lines.append(line)
        return check_text("\n".join(lines), "<golden>")


@cache
def _checked(text: str) -> CheckedSpec:
    return check_text(text, "<golden>")


def read(path: Path) -> tuple[str, tuple[Scene, ...]]:
    """What phi is in words, and the scenes."""
    head, *parts = re.split(r"^== ", path.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return " ".join(head.split()), tuple(map(_scene, parts))


def _scene(part: str) -> Scene:
    title, *lines = [line for line in part.splitlines() if line]
    last = next(place for place, line in enumerate(lines) if line.startswith("task:"))
    spec, poses = [], []
    for line in lines[: last + 1]:
        found = _AT.match(line)
        if found:
            line, _, pose = found.groups()
            x, y, *turned = map(float, pose.split(","))
            poses.append((x, y, math.radians(turned[0] if turned else 0.0)))
        spec.append(line)
    return Scene(title, "\n".join(spec), tuple(poses), tuple(lines[last + 1 :]))


def work_out(lines: tuple[str, ...]) -> dict[str, float]:
    """The names of the arithmetic with their values. Raises AssertionError where the sides of an equation differ."""
    known = {"pi": math.pi}
    for line in lines:
        name, *sides = line.split(" = ")
        values = [_value(ast.parse(side, mode="eval").body, known) for side in sides]
        assert all(abs(value - values[0]) <= SLIP for value in values), f"{line}: {values}"
        known[name] = values[0]
    return known


def _value(node: ast.expr, known: dict[str, float]) -> float:
    match node:
        case ast.Constant(int() | float() as number):
            return float(number)
        case ast.Name(name):
            return known[name]
        case ast.UnaryOp(ast.USub(), operand):
            return -_value(operand, known)
        case ast.BinOp(base, ast.Pow(), ast.Constant(2)):
            return _value(base, known) ** 2
        case ast.BinOp(left, step, right):
            return float(_OPERATORS[type(step)](_value(left, known), _value(right, known)))
        case ast.Call(ast.Name(function), arguments):
            return float(_FUNCTIONS[function](*(_value(argument, known) for argument in arguments)))
    raise AssertionError(f"no arithmetic: {ast.unparse(node)}")
