"""Monitoring step by step: what phi of a motion can still become, while it happens."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from scenegen.api.spec import Spec, check_spec
from scenegen.arrays import Array, as_numbers
from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.files import HELD_ELSEWHERE, TABLE_UNUSED, TRAJECTORY_START
from scenegen.errors.requests import MOTION_HAS_ENDED, NOT_OVER_TIME, UNKNOWN_OBJECT, WRONG_VALUE
from scenegen.lang.formula.timed import Timed, TimedValues, score
from scenegen.pose import SIZE, as_rows
from scenegen.sampling.motions.monitor import HIGH, LOW, BatchMonitor
from scenegen.scenes.arrange import doubts_of, fixed_pose_facts, held_elsewhere
from scenegen.scenes.formats.tables import motion, read_tables
from scenegen.validation import as_path


@dataclass(frozen=True, slots=True)
class Outlook:
    """What can still become of a motion after its latest moment, number `moment` from 0, `t` seconds after the first.

    `low` and `high` are, by label, the least and the largest phi of the whole motion that is still possible: numbers,
    or (B,) for B motions. They are equal once nothing to come matters. `required` are the same two for the least margin
    of what the spec requires, None where it requires nothing. `warnings` are about poses of the moment that by their
    numbers are in other units.
    """

    moment: int
    t: float
    low: Mapping[str, float | Array]
    high: Mapping[str, float | Array]
    required: tuple[float | Array, float | Array] | None
    warnings: tuple[Diagnostic, ...] = ()

    def settled(self, label: str) -> bool | npt.NDArray[np.bool_]:
        """Whether it is certain that the label is satisfied, or certain that it is not. Raises KeyError."""
        low, high = self.low[label], self.high[label]
        found = np.asarray((np.asarray(low) >= 0.0) | (np.asarray(high) < 0.0))
        return found if found.shape else bool(found)


class Monitor:
    """Bounds on phi of a motion while it happens, for a spec over time.

    `add` takes the poses of the next moment, and says what phi can still become: for every motion that stays in the
    workspace, and with `reach` only for those whose steps are no longer than the spec requires, which narrows it much.
    After the last moment low and high are phi. A call costs about as much as scoring two motions; with `reach`, bounds
    of the state at every moment to come on top.

    >>> import scenegen
    >>> spec = scenegen.parse("object mug time 3 steps task: eventually rightOf(mug, (0.5, 0.5))")
    >>> monitor = scenegen.Monitor(spec)
    >>> seen = monitor.add({"mug": (0.6, 0.5, 0.0)})
    >>> round(seen.low["task"], 6), seen.high["task"], seen.settled("task")
    (0.1, 0.5, True)
    """

    def __init__(self, spec: Spec, *, reach: bool = False) -> None:
        """Raises RequestError for a spec without `time`."""
        check_spec(spec)
        if spec.over_time is None:
            raise RequestError(NOT_OVER_TIME(file=spec.definition.name))
        self._spec, self._timed, self._reach = spec, spec.over_time, bool(reach)
        self._watch: BatchMonitor | None = None
        self._batch: tuple[int, ...] = ()

    def add(self, poses: Mapping[str, tuple[float, ...]] | npt.ArrayLike) -> Outlook:
        """The next moment: poses by name (objects that the spec holds can be left out), or an array (N, 3) or
        (B, N, 3), metres and radians. Raises RequestError for poses of another form, for an object that the spec holds
        elsewhere, and beyond the last moment."""
        horizon = self._timed.horizon
        if self._watch is not None and self._watch.seen[0] >= horizon.moments:
            raise RequestError(MOTION_HAS_ENDED(moments=horizon.moments, end=horizon.seconds))
        array = self.read(poses)
        if self._watch is None:
            self._batch = array.shape[:-2]
            count = self._batch[0] if self._batch else 1
            self._watch = BatchMonitor(self._timed, *self._spec.definition.box(), self._reach, count)
        self._watch.add(as_rows(array.reshape(-1, *array.shape[-2:])))
        moment, required = int(self._watch.seen[0]) - 1, self._watch.required
        low, high = (
            {name: self._as_given(value[end]) for name, value in self._watch.phi.items()} for end in (LOW, HIGH)
        )
        both = (
            None if self._timed.requirement is None else (self._as_given(required[LOW]), self._as_given(required[HIGH]))
        )
        spec, rows = self._spec.definition, array.reshape(-1, *array.shape[-2:])
        doubts = doubts_of("`poses`", spec.objects, rows, spec.workspace, int(bool(self._batch)))
        return Outlook(moment, moment * horizon.dt, low, high, both, tuple(doubts))

    def read(self, poses: Mapping[str, tuple[float, ...]] | npt.ArrayLike) -> Array:
        """What `add` takes as an array, checked, without adding it. Raises RequestError for poses of another form."""
        array = self._by_name(poses) if isinstance(poses, Mapping) else _numbers(poses)
        self._check(array)
        return array

    def reset(self) -> None:
        """Forget what was seen: the next moment is the first of another motion."""
        self._watch = None

    def _as_given(self, values: Array) -> float | Array:
        return values.copy() if self._batch else float(values[0])

    def _by_name(self, poses: Mapping[str, tuple[float, ...]]) -> Array:
        names, held = self._spec.objects, self._spec.definition.fixed
        for name in poses:
            if name not in names:
                raise RequestError(UNKNOWN_OBJECT(name=str(name), known=names))
        rows: list[object] = []
        for index, name in enumerate(names):
            if name in poses:
                rows.append(poses[name])
            elif index in held:
                rows.append(held[index])
            else:
                raise RequestError(WRONG_VALUE(argument="poses", value=f"without `{name}`", wanted="every free object"))
        return _numbers(rows)

    def _check(self, array: Array) -> None:
        count = len(self._spec.objects)
        batch = self._batch if self._watch is not None else array.shape[:-2]
        fits = array.ndim in (2, 3) and array.shape[-2:] == (count, SIZE) and array.shape[:-2] == batch and array.size
        if not fits:
            first = "" if self._watch is None or not batch else f"{batch[0]}, "
            wanted = f"an array of shape ({first}{count}, {SIZE}): x, y, theta of each object"
            raise RequestError(WRONG_VALUE(argument="poses", value=f"of shape {array.shape}", wanted=wanted))
        if not np.isfinite(array).all():
            raise RequestError(WRONG_VALUE(argument="poses", value="not finite everywhere", wanted="finite numbers"))
        found = held_elsewhere(self._spec.definition, as_rows(array.reshape(-1, count, SIZE)))
        if found is not None:
            moment = 0 if self._watch is None else self._watch.seen[0]
            place = f"at moment {moment}" + (f" of motion {found[1]}" if batch else "")
            raise RequestError(HELD_ELSEWHERE(**fixed_pose_facts(self._spec.definition, found[0]), place=place))


def _numbers(poses: object) -> Array:
    try:
        return as_numbers(poses)
    except (TypeError, ValueError):
        raise RequestError(
            WRONG_VALUE(argument="poses", value="not an array of numbers", wanted="x, y, theta of each object")
        ) from None


def read_trajectories(
    spec: Spec, path: str | Path, *, resample: bool = False
) -> tuple[dict[int | None, npt.NDArray[np.float64]], list[Diagnostic]]:
    """The poses of a file's trajectories at the moments of a spec over time, by the number that the file gives them
    (None in a file of one that does not say), (T + 1, N, 3) each; and notes about what was left out.

    CSV, JSON Lines or Parquet: `t` in seconds, `mug.x`, `mug.y`, `mug.theta`, ... in metres and radians, one row a
    moment; `motion` numbers several motions of a file. Times may count from any moment, that of the first row. Or a
    file of motions that scenegen wrote. With `resample`, rows
    at other times are interpolated. Raises RequestError for a spec without `time`, and DataError for what is no such
    file, and where an object that the spec holds stands elsewhere.
    """
    check_spec(spec)
    path = as_path("path", path)
    timed = _require_time(spec)
    horizon = timed.horizon
    times = np.arange(horizon.moments, dtype=np.float64) * np.float64(horizon.dt)
    found: dict[int | None, npt.NDArray[np.float64]] = {}
    left_out: list[str] = []
    starts: list[float] = []
    warnings: list[Diagnostic] = []
    for table in read_tables(path):
        found[table.number], left_out, start, doubts = motion(
            table, timed.objects, spec.definition.fixed, times, spec.definition.workspace, resample
        )
        starts.append(start)
        warnings = warnings or doubts
        moved = held_elsewhere(spec.definition, as_rows(found[table.number]))
        if moved is not None:
            place = f"at moment {moved[1]}" + (f" of motion {table.number}" if table.number is not None else "")
            raise DataError(HELD_ELSEWHERE(**fixed_pose_facts(spec.definition, moved[0]), place=f"{place} in {path}"))
    notes = warnings + ([TABLE_UNUSED(file=path, columns=left_out)] if left_out else [])
    return found, notes + ([TRAJECTORY_START(file=path, start=max(starts))] if any(starts) else [])


def score_trajectory(spec: Spec, poses: npt.NDArray[np.float64]) -> TimedValues:
    """phi of one motion, (T + 1, N, 3), at every moment, and what decides it; in numpy, float64."""
    return score(_require_time(spec), poses)


def _require_time(spec: Spec) -> Timed:
    if spec.over_time is None:
        raise RequestError(NOT_OVER_TIME(file=spec.definition.name))
    return spec.over_time
