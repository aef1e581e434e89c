"""Motions for the page: what they are worth, at every moment, and why; and a set of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.api.monitor import score_trajectory
from scenegen.api.motions import MotionSet
from scenegen.api.request import request_data
from scenegen.api.scene_arrays import make_header
from scenegen.api.spec import Spec
from scenegen.errors import DataError
from scenegen.errors.program import NO_MESSAGE
from scenegen.lang.formula.core import REQUIRE
from scenegen.lang.formula.timed import TimedValues
from scenegen.sampling.motions.scores import TraceScores
from scenegen.sampling.request import SampleRequest
from scenegen.scenes.data import RequestData
from scenegen.scenes.motions import MotionFile, MotionRequestData, TimeData
from scenegen.show.figures.dimensions import dimensions
from scenegen.show.view.jobs.describe import stage_of_spec
from scenegen.show.view.jobs.source import mark_data
from scenegen.show.view.jobs.trees import check_size, own, timed_of, trees_of
from scenegen.things.overlap import overlapping
from scenegen.things.surfaces import base_heights

Array = npt.NDArray[np.float64]

MOST_VALUES = 40_000  # lines times moments whose values are all sent; of longer motions those that count


def motions_of(spec: Spec, poses: object) -> Array:
    """Motions as they come from a page, (n, T + 1, N, 3). Raises DataError for what are no motions of the spec's
    objects and moments, RequestError for too many."""
    shape = timed_of(spec).horizon.moments, len(spec.objects), 3
    try:
        array = np.array(poses, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.ndim != 4 or array.shape[1:] != shape or not np.isfinite(array).all():
        raise DataError(NO_MESSAGE(reason=f"no motions of {shape[1]} objects at {shape[0]} moments"))
    check_size(spec, len(array))
    return array


def told(spec: Spec, motions: Array) -> dict[str, Any]:
    """What the page shows of motions (n, T + 1, N, 3): phi of each label and the margin of what is required, (n,) each,
    and how high above the table each object stands at every moment, in metres; None where all stand on it."""
    scores = TraceScores(timed_of(spec))(np.ascontiguousarray(motions.transpose(2, 3, 1, 0)))
    required = None if timed_of(spec).requirement is None else scores[-1].tolist()
    heights = bases_of(spec, motions)
    return {
        "phi": {name: row.tolist() for name, row in zip(spec.labels, scores[:-1], strict=True)},
        "require": required,
        "bases": heights.tolist() if heights.any() else None,
        "on": None,
    }


def bases_of(spec: Spec, motions: Array) -> Array:
    """How high above the table each object stands, in metres: (n, T + 1, N)."""
    stage = stage_of_spec(spec)
    flat = motions.reshape(-1, *motions.shape[2:])
    heights = base_heights([thing.shape for thing in stage.things], flat, declared=stage.declared)
    return np.broadcast_to(heights, flat.shape[:2]).reshape(motions.shape[:3])


def reasons(spec: Spec, motion: Array, *, everything: bool = True) -> dict[str, Any]:
    """Of one motion (T + 1, N, 3): phi from every moment on, the value of every line of the trees where it counts and
    (`everything`, unless there are too many) at every moment, what decides each label, and what overlaps at the last
    moment."""
    trees, scored = trees_of(spec), score_trajectory(spec, motion)
    values = trees.values(scored)
    at = trees.moments(scored, values)
    labels = [*spec.labels, *([REQUIRE] if timed_of(spec).requirement is not None else [])]
    signals = {**scored.signals, **({} if scored.required is None else {REQUIRE: scored.required})}
    shapes = [thing.shape for thing in stage_of_spec(spec).things]
    return {
        "signals": {name: row.tolist() for name, row in signals.items()},
        "values": values[np.arange(len(values)), at].tolist(),
        "at": at,
        "over": _short(values) if everything and values.size <= MOST_VALUES else None,
        "decides": {label: _decides(spec, label, scored, motion, at) for label in labels},
        "overlaps": [[spec.objects[a], spec.objects[b]] for a, b in overlapping(shapes, motion[-1:], None)[0]],
    }


def _short(values: Array) -> list[list[float]]:
    """To six digits: they colour a tree."""
    return [[float(f"{one:.6g}") for one in row] for row in values.tolist()]


def _decides(spec: Spec, label: str, scored: TimedValues, motion: Array, at: list[int]) -> dict[str, Any] | None:
    timed, trees = timed_of(spec), trees_of(spec)
    try:
        atom, moment = scored.decides(None if label == REQUIRE else label)
    except (ValueError, StopIteration):  # infinite in this motion
        return None
    core = timed.state
    index = next(number for number, node in enumerate(core.nodes) if node is atom)
    now, before = motion[moment], motion[max(moment - 1, 0)]
    rows = np.concatenate([now, before]) if timed.steps else now
    values = scored.states[index]
    mine = [number for number, one in enumerate(trees.places) if index in one.states]
    return {
        "text": atom.text,
        "spans": [[one.start, one.end] for one in own(atom.spans)] if atom.spans else [],
        "value": float(values[moment]),
        "lines": [number for number in mine if at[number] == moment] or mine,
        "marks": [mark_data(one) for one in dimensions(core, index, rows.reshape(-1).tolist())],
        "required": label == REQUIRE,
        "moment": moment,
        "signal": values.tolist(),
    }


def motion_set(spec: Spec, motions: Array, sampler: Mapping[str, Any], request: SampleRequest) -> MotionSet:
    """Motions from a page as a set with its header; phi is computed again."""
    horizon = timed_of(spec).horizon
    scenes = make_header(spec.declared, dict(sampler), RequestData(phi={}, n=len(motions)))
    header = MotionFile(
        spec=scenes.spec, workspace=scenes.workspace, objects=scenes.objects, regions=scenes.regions,
        sampler=dict(sampler), time=TimeData(steps=horizon.steps, dt=horizon.dt), motions=[],
        request=MotionRequestData(phi=request_data(request).phi, n=request.n),
    )  # fmt: skip
    phi = {name: np.array(values) for name, values in told(spec, motions)["phi"].items()}
    steps = np.hypot(*np.moveaxis(np.diff(motions[..., :2], axis=1), -1, 0))
    facts = {"moved": (steps > 0.0).any(axis=1).sum(axis=1).astype(np.float64), "way": steps.sum(axis=(1, 2))}
    return MotionSet(motions, phi, facts, header)
