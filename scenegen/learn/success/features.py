"""What of a start may tell whether a policy succeeds: phi and the margins of the success formula, how crowded the table
is, distances and places. How rare phi is follows from phi, and tells no more."""

from __future__ import annotations

import hashlib
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from typing import Literal

import numpy as np

from scenegen.arrays import Array
from scenegen.geometry import NUMPY, PRIMITIVES
from scenegen.lang.formula.core import Atom, Coord, atoms_below, children, nodes_below, renumber
from scenegen.lang.formula.interpret import evaluate, is_constant
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import FLAT, PLACE, span_of

Kind = Literal["phi", "margin", "clutter", "distance", "place"]
MONOTONE_KINDS: tuple[Kind, ...] = ("phi", "margin")  # a start where more of these is there is no harder
MAX_FEATURE_OBJECTS = 8  # objects of the success formula whose distances and surroundings are looked at
NEAR_DISTANCE = 0.1  # metres


@dataclass(frozen=True, slots=True)
class Feature:
    """A number of each start: its name in words, and what kind of number it is."""

    name: str
    kind: Kind


def measure_features(spec: CheckedSpec, label: str, rows: Array) -> tuple[tuple[Feature, ...], Array]:
    """The features of a spec whose label `label` is success, and their values, (F, B), in scenes with the core's rows
    (3M, B).

    Margins that one place of the spec writes for many objects, as `noOverlap()` does, count as one, the least of them.
    """
    features = [*_formula_features(spec, label, rows), *_table_features(spec, things_of(spec, label), rows)]
    values = np.stack([np.broadcast_to(value, rows.shape[1]) for _, value in features])
    return tuple(feature for feature, _ in features), values


def fingerprint(spec: CheckedSpec, label: str) -> str:
    """SHA-256 of all that features follow from: the objects, the workspace and the formula of the label. What the spec
    requires, and its other labels, are no part of it."""
    formulas: list[str] = []
    for node in spec.core.nodes:
        own = node.text if isinstance(node, Atom) else renumber(node, defaultdict(int))
        formulas.append(_sha256(own, [formulas[child] for child in children(node)]))
    things = [(name, shape.footprint) for name, shape in zip(spec.objects, spec.shapes, strict=True)]
    return _sha256(label, things, sorted(spec.fixed.items()), spec.workspace, formulas[spec.core.labels[label]])


def _sha256(*values: object) -> str:
    return hashlib.sha256(repr(values).encode()).hexdigest()


def things_of(spec: CheckedSpec, label: str) -> list[int]:
    """The objects that the success formula is about, then those that the spec holds in place (formulas have numbers
    instead of these), at most so many."""
    nodes = (spec.core.nodes[index] for index in nodes_below(spec.core.nodes, [spec.core.labels[label]]))
    read = {node.object for node in nodes if isinstance(node, Coord)}
    free = sorted(one for one in read if one < len(spec.objects))
    return [*free, *(one for one in sorted(spec.fixed) if one not in free)][:MAX_FEATURE_OBJECTS]


def _formula_features(spec: CheckedSpec, label: str, rows: Array) -> Iterator[tuple[Feature, Array]]:
    core = spec.core
    values = evaluate(core, list(rows), NUMPY)
    yield Feature(f"phi of {label}", "phi"), values[core.labels[label]]
    together: dict[object, list[tuple[str, Array]]] = defaultdict(list)
    for index in atoms_below(core, core.labels[label]):
        atom = core.nodes[index]
        if isinstance(atom, Atom) and not is_constant(core, index):
            together[atom.spans].append((atom.text, values[index]))
    for place, alike in enumerate(together.values(), 1):
        text = f"{alike[0][0]}, the least of {len(alike)}" if len(alike) > 1 else alike[0][0]
        yield Feature(f"margin {place}, of {text}", "margin"), reduce(np.minimum, [margin for _, margin in alike])


def _table_features(spec: CheckedSpec, things: list[int], rows: Array) -> Iterator[tuple[Feature, Array]]:
    names, gap = spec.objects, PRIMITIVES["gap"].evaluate
    poses = [rows[span_of(which, len(FLAT))] for which in range(len(names))]
    rooms, near = [], np.zeros(rows.shape[1])
    shapes = [one.footprint for one in spec.shapes]
    for one in things:
        others = [other for other in range(len(names)) if other != one]
        gaps = [gap(NUMPY, shapes[one], shapes[other], *poses[one], *poses[other]) for other in others]
        if gaps:
            rooms.append(reduce(np.minimum, gaps))
            near = near + sum((each < NEAR_DISTANCE).astype(np.float64) for each in gaps)
            yield Feature(f"room around {names[one]}", "clutter"), rooms[-1]
    if rooms:
        yield Feature("least room", "clutter"), reduce(np.minimum, rooms)
        yield Feature("mean room", "clutter"), np.mean(rooms, axis=0)
        yield Feature(f"things within {NEAR_DISTANCE:g} m", "clutter"), near
    for place, one in enumerate(things):
        for other in things[:place]:
            apart = np.hypot(*(poses[one][axis] - poses[other][axis] for axis in PLACE))
            yield Feature(f"distance of {names[other]} and {names[one]}", "distance"), apart
    middle_x, middle_y = (sum(ends) / 2.0 for ends in (spec.workspace.x, spec.workspace.y))
    for one in (one for one in things if one not in spec.fixed):
        x, y, theta = poses[one]
        yield Feature(f"distance of {names[one]} from the middle", "distance"), np.hypot(x - middle_x, y - middle_y)
        yield Feature(f"x of {names[one]}", "place"), x
        yield Feature(f"y of {names[one]}", "place"), y
        yield Feature(f"cos of the heading of {names[one]}", "place"), np.cos(theta)
        yield Feature(f"sin of the heading of {names[one]}", "place"), np.sin(theta)
