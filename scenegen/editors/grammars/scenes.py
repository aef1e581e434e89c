"""Scenes that meet what a spec requires: what can be said is held against them."""

from __future__ import annotations

import re

import numpy as np
import numpy.typing as npt

from scenegen.errors import Source
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import REQUIRE, Core, gated, part_of
from scenegen.lang.formula.interpret import phi
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.syntax import ast
from scenegen.lang.syntax.parse import parse
from scenegen.lang.syntax.printer import print_statement
from scenegen.pose import SIZE
from scenegen.search.prune import find

Array = npt.NDArray[np.float64]

SCENES = 512
DRAWS = 12  # blocks of uniform scenes that are looked through
ENOUGH = 64  # valid ones among them, or chains are run from those that there are
ROUNDS = 150  # moves of one object each


def valid_scenes(spec: CheckedSpec, seed: int = 0) -> Array | None:
    """Up to SCENES scenes (3N, M) that meet what the spec requires, the same for the same seed; None where none was
    found. Uniform ones where these are common enough; else moves of single objects lead from one to the next. Of a
    spec over time they are moments, and its requirement is not looked at."""
    lowest, highest = spec.box()
    rng = np.random.default_rng(seed)
    if spec.timed is not None:
        return _uniform(lowest, highest, rng)
    core = gated(spec.core)
    if REQUIRE not in core.labels:
        return _uniform(lowest, highest, rng)
    core = part_of(core, (REQUIRE,))
    kept: list[Array] = []
    for _ in range(DRAWS):
        rows = _uniform(lowest, highest, rng)
        kept.append(rows[:, _valid(core, rows)])
        if sum(one.shape[1] for one in kept) >= SCENES:
            return np.concatenate(kept, axis=1)[:, :SCENES]
    found = np.concatenate(kept, axis=1)
    if not found.shape[1]:
        witness = find(core, lowest, highest, {core.labels[REQUIRE]: (0.0, np.inf)}).witness
        if witness is None:
            return None
        found = witness[:, None]
    return found if found.shape[1] >= ENOUGH else _chains(core, lowest, highest, found, rng)


def _uniform(lowest: Array, highest: Array, rng: np.random.Generator) -> Array:
    return lowest[:, None] + (highest - lowest)[:, None] * rng.random((len(lowest), SCENES))


def _valid(core: Core, rows: Array) -> npt.NDArray[np.bool_]:
    return np.broadcast_to(phi(core, list(rows), NUMPY)[REQUIRE], rows.shape[1]) >= 0.0


def _chains(core: Core, lowest: Array, highest: Array, start: Array, rng: np.random.Generator) -> Array:
    """Chains from valid scenes: in each round one object goes to a place of its own, near or far."""
    rows = np.resize(start.T, (SCENES, len(lowest))).T.copy()
    objects = len(lowest) // SIZE
    for _ in range(ROUNDS):
        moved = rows.copy()
        which = SIZE * rng.integers(objects, size=SCENES)
        near = rng.random(SCENES) < 0.5
        for axis in range(SIZE):
            at, ends = (which + axis, np.arange(SCENES)), (lowest[which + axis], highest[which + axis])
            far = ends[0] + (ends[1] - ends[0]) * rng.random(SCENES)
            step = rows[at] + 0.05 * (ends[1] - ends[0]) * rng.standard_normal(SCENES)
            moved[at] = np.clip(np.where(near, step, far), *ends)
        good = _valid(core, moved)
        rows[:, good] = moved[:, good]
    return rows


# --------------------------------------------------------------------------------------------------------------------
# The part of a spec that an answer continues: its declarations, without its labels.


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
    stack: list[ast.Expr | ast.Argument] = list(ast.expressions(statement))
    while stack:
        node = stack.pop()
        if isinstance(node, ast.Name):
            found.add(node.id)
        stack.extend(ast.children(node))
    return found
