"""Scenes of a file as a spec has them: its objects in its order, in its workspace, as it requires. Plain numpy."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import DataError, Diagnostic, quote_names
from scenegen.errors.declarations import NUMBERS_IN_FILE
from scenegen.errors.files import DOUBTFUL_POSE, HELD_ELSEWHERE, NO_SURFACE_GIVEN, OTHER_SPEC, SCENE_NOT_ALLOWED
from scenegen.geometry import NUMPY
from scenegen.geometry.workspace import Workspace
from scenegen.lang.formula.core import REQUIRE, gate
from scenegen.lang.formula.interpret import phi as score
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import NAMES, PLACE, THETA, TWO_PI, X, row_count, row_of, rows_along, rows_of, span_of
from scenegen.scenes.data import SceneFile

HELD_TOLERANCE = 1e-9  # metres and radians by which an object that is held in place may be off in a file
OUTSIDE = 1e-6  # metres by which a centre may lie outside of the workspace: files of other programs round
UNMET = 1e-6  # by which a requirement may be missed, for the same reason


def order_of(spec: CheckedSpec, objects: Sequence[str]) -> list[int]:
    """Where each object of the spec stands among `objects`. Raises DataError unless they are the same."""
    if set(objects) != set(spec.objects):
        missing = sorted(set(spec.objects) - set(objects))
        extra = sorted(set(objects) - set(spec.objects))
        parts = [f"the scenes lack {quote_names(missing)}"] if missing else []
        parts += [f"the spec does not know {quote_names(extra)}"] if extra else []
        names = {"wanted": tuple(spec.objects), "found": tuple(objects)}
        raise DataError(OTHER_SPEC(reason="; ".join(parts), **names))
    place = {name: index for index, name in enumerate(objects)}
    return [place[name] for name in spec.objects]


def refuse_numbers(header: SceneFile, what: str) -> None:
    """Raises DataError for scenes that differ in how many things there are."""
    for one in header.counts[:1]:
        raise DataError(
            NUMBERS_IN_FILE(what=what, name=one.name, most=one.most, asset=one.assets[0] if one.assets else None)
        )


def reorder(rows: Array, order: Sequence[int]) -> Array:
    """(3N, m) storage with its objects in another order."""
    if list(order) == sorted(order):
        return rows
    return rows[[row for place in order for row in rows_of(place)]]


def as_core(spec: CheckedSpec, header: SceneFile, rows: Array, order: Sequence[int]) -> Array:
    """The rows of a block of a file as the core has them: objects in another order, then switches. Raises DataError."""
    refuse_numbers(header, "training")
    count = row_count(len(header.objects))
    return with_switches(spec, header, reorder(rows[:count], order), rows[count:].T)


def with_switches(spec: CheckedSpec, header: SceneFile, rows: Array, on: Array | None) -> Array:
    """Rows (3N, n) and below them those of the switches of the spec's choices; `on` (n, M) says on which of its
    surfaces each of the header's choosers stands, counted from 1. Raises DataError where that is not said of
    an object, or it stands on a surface that the spec does not have."""
    if not spec.choices:
        return rows
    found = np.zeros((row_count(len(spec.core.objects)), rows.shape[1]))
    found[: len(rows)] = rows
    choosers = {one.name: number for number, one in enumerate(header.choosers)}
    for which, choice in spec.choices.items():
        name = spec.objects[which]
        if on is None or name not in choosers:
            raise DataError(NO_SURFACE_GIVEN(name=name))
        support = header.choosers[choosers[name]].support
        assert support is not None
        middles = dict(zip((one.name for one in choice.options), choice.middles, strict=True))
        values = np.array([middles.get(one.on, np.nan) for one in support.any])
        numbers = values[on[:, choosers[name]].astype(np.intp) - 1]
        if np.isnan(numbers).any():
            raise DataError(NO_SURFACE_GIVEN(name=name))
        found[row_of(choice.switch, X)] = numbers
    return found


def check_held(spec: CheckedSpec, rows: Array, before: int = 0) -> None:
    """Raises DataError where an object that the spec holds in place stands elsewhere in `rows` (3N, m), the spec's
    objects in order; `before` scenes of the file came before these."""
    found = held_elsewhere(spec, rows)
    if found is not None:
        which, scene = found
        raise DataError(HELD_ELSEWHERE(**fixed_pose_facts(spec, which), scene=before + scene + 1))


def held_elsewhere(
    spec: CheckedSpec, rows: Array, metres: float = HELD_TOLERANCE, radians: float = HELD_TOLERANCE
) -> tuple[int, int] | None:
    """The first object that the spec holds in place and that stands elsewhere in `rows` (3N, m), and in which column;
    None if all are in their places. Headings are compared on the circle."""
    for index, pose in spec.fixed.items():
        off = rows[span_of(index, len(pose))] - np.array(pose)[:, None]
        off[THETA] = np.remainder(off[THETA] + np.pi, TWO_PI) - np.pi
        moved = (np.abs(off) > np.array([metres, metres, radians])[:, None]).any(axis=0)
        if moved.any():
            return index, int(moved.argmax())
    return None


def fixed_pose_facts(spec: CheckedSpec, which: int) -> dict[str, str]:
    """The facts of an object that the spec holds, for HELD_ELSEWHERE."""
    return {"name": spec.objects[which], "pose": ", ".join(f"{number:g}" for number in spec.fixed[which])}


def check_scenes(spec: CheckedSpec, rows: Array, before: int = 0) -> None:
    """Raises DataError for a scene that the base distribution of the spec does not have: with an object that is held
    elsewhere, a centre outside of the workspace, or something required that is not met."""
    check_held(spec, rows, before)
    low, high = spec.box()
    for axis in PLACE:
        part = rows_along(axis)
        over = np.maximum(low[part, None] - rows[part], rows[part] - high[part, None])
        if over.size and over.max() > OUTSIDE:
            index, scene = np.unravel_index(int(over.argmax()), over.shape)
            raise DataError(SCENE_NOT_ALLOWED(name=spec.objects[int(index)], scene=before + int(scene) + 1))
    if spec.core.requirement is None:
        return
    margin = np.broadcast_to(score(gate(spec.core), list(rows), NUMPY)[REQUIRE], rows.shape[1])
    if (margin < -UNMET).any():
        first = before + int((margin < -UNMET).argmax())
        raise DataError(SCENE_NOT_ALLOWED(scene=first + 1))


def doubts(file: str, columns: Iterable[tuple[str, Array]], table: Workspace, first: int = 1) -> list[Diagnostic]:
    """Warnings for columns of poses, such as mug.theta, that by their numbers are not in radians, or not on the table:
    at most one of each. `first` is the row of their first number, 0 where there is no other."""
    found: dict[bool, Diagnostic] = {}
    ends = _ends(table)
    for name, values in columns:
        axis = NAMES.index(name.rpartition(".")[2])
        turns, (low, high) = axis == THETA, ends[axis]
        if turns:
            doubt, remedy = "more than a turn", "headings are in radians: numpy.radians(90) is 1.5708"
        else:
            doubt = f"outside of the workspace, which ends at {low:g} and {high:g}"
            remedy = "places are in metres, in the frame of the spec's workspace"
        slack = 1e-9 * (high - low)
        odd = np.flatnonzero((values < low - slack) | (values > high + slack))
        if turns not in found and len(odd):
            row, value = first + int(odd[0]) if first else None, float(values[odd[0]])
            facts = {"row": row, "value": value, "doubt": doubt, "remedy": remedy}
            found[turns] = DOUBTFUL_POSE(file=file, name=name, **facts)
    return list(found.values())


def doubts_of(file: str, objects: Sequence[str], poses: Array, table: Workspace, first: int = 1) -> list[Diagnostic]:
    """The same for poses (n, N, 2) or (n, N, 3) of these objects."""
    axes = NAMES[: poses.shape[-1]]
    low, high = _ends(table)[: len(axes)].T
    if not ((poses < low) | (poses > high)).any():
        return []
    columns = ((f"{one}.{axis}", poses[:, k, a]) for k, one in enumerate(objects) for a, axis in enumerate(axes))
    return doubts(file, columns, table, first)


@functools.cache
def _ends(table: Workspace) -> Array:
    """(3, 2): between which ends x, y and theta are expected: places on the table, headings within a turn."""
    every = [(table.x, table.y), *(one[1:] for one in table.own)]
    places = [(min(one[axis][0] for one in every), max(one[axis][1] for one in every)) for axis in PLACE]
    return np.array([*places, (-TWO_PI, TWO_PI)])
