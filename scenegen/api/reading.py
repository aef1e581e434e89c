"""Scenes read: files and sets of scenegen, and poses of other programs in arrays, tables and files, with phi."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet, evaluate, scene_set
from scenegen.arrays import Array, as_numbers
from scenegen.errors import DataError, RequestError
from scenegen.errors.declarations import NUMBERS_DISAGREE
from scenegen.errors.files import (
    COLUMN_NOT_A_NUMBER,
    NO_SURFACE_GIVEN,
    NOT_SCENES,
    OTHER_SPEC,
    OTHER_SURFACE,
    TABLE_COLUMN,
    TABLE_UNUSED,
)
from scenegen.errors.requests import NO_SCENES, OUT_OF_PLACE, OUT_OF_RANGE, UNKNOWN_OBJECT, WRONG_VALUE
from scenegen.geometry.workspace import upright
from scenegen.lang.spec import CheckedSpec
from scenegen.lang.tables import Table
from scenegen.pose import NAMES, X, as_rows
from scenegen.scenes.arrange import doubts_of
from scenegen.scenes.blocks import SceneFileReading, counts_in
from scenegen.scenes.data import ObjectData, Pose, RequestData, SceneFile
from scenegen.scenes.files import read_bytes
from scenegen.scenes.formats import registry as table
from scenegen.scenes.formats.header import not_scenes, parse
from scenegen.scenes.formats.scenes_json import MAX_JSON_BYTES, REMEDY
from scenegen.scenes.formats.settled import is_settled, read_settled
from scenegen.scenes.formats.tables import is_plain, read_table
from scenegen.scenes.locations import as_location, is_set
from scenegen.validation import as_int, as_path

ON_COLUMN = "on"
WANTED = 'poses by name, {"mug": (x, y, theta), ...}, columns mug.x, mug.y, mug.theta, or an array (n, %d, 3)'


@dataclass(frozen=True, slots=True)
class _GivenScenes:
    """`count` scenes in a place called `name`: `columns` are coordinates by mug.x, (count,), `on` on what things stand
    by mug.on, by name or number; what is not said is missing. `unused` is what no object needs."""

    name: str
    count: int
    columns: Mapping[str, Array]
    on: Mapping[str, Sequence[Any]]
    unused: tuple[str, ...] = ()


class AnySpec(Protocol):
    """A Spec, as far as reading scenes needs it."""

    def require_scenes(self) -> CheckedSpec: ...


def read_scenes(path: str | Path, *, start: int = 0, stop: int | None = None, spec: AnySpec | None = None) -> SceneSet:
    """Read a scene file of any format, or a set by its folder or URL; or only scenes from `start` up to, not including,
    `stop` (counted from 0). `spec` is that of a file of poses alone: a table (.csv, .jsonl, .parquet) with the columns
    mug.x, mug.y, mug.theta, ..., or scenes with poses by name (.json, .jsonl); phi is computed.

    Raises DataError, also for more scenes than go into memory, and RequestError for an ending that no format has, and
    for a `spec` beside a file that has its own.
    """
    for name, value in (("start", start), ("stop", stop)):
        if value is not None and as_int(name, value) < 0:
            raise RequestError(OUT_OF_RANGE(argument=name, value=value, wanted="0 or more"))
    if is_set(path):
        if spec is not None:
            raise _says_itself(path)
        from scenegen.scenes.sets import read_set
        from scenegen.scenes.stores import open_store

        reading = read_set(open_store(as_location(path)))
    else:
        found = open_scenes(as_path("path", path), spec)
        if isinstance(found, SceneSet):
            return found if (start, stop) == (0, None) else found[start:stop]
        reading = found
    return scene_set(reading.header, reading.labels, reading.whole(start, stop))


def open_scenes(path: Path, spec: AnySpec | None = None) -> SceneFileReading | SceneSet:
    """A scene file, open; or the scenes of one that holds poses alone, of `spec`. Raises what `read_scenes` raises."""
    if spec is None:
        if is_settled(path):
            return settled_scenes(path)
        return table.read_scenes(path)
    if not is_plain(path):
        table.read_scenes(path)  # says what else is wrong with it
        raise _says_itself(path)
    checked = spec.require_scenes()
    return _scenes(checked, _file(checked, path))


def _says_itself(path: str | Path) -> RequestError:
    rule = f"is for files of poses alone, and {path} says itself of what spec it is"
    return RequestError(OUT_OF_PLACE(argument="spec", rule=rule, remedy="leave it out"))


def reading_of(path: Path, spec: AnySpec | None = None) -> SceneFileReading:
    """The same, open: for what goes through scenes block by block."""
    found = open_scenes(path, spec)
    if not isinstance(found, SceneSet):
        return found
    found.refuse_rest(path)
    return SceneFileReading(found.header, tuple(found.phi), found.blocks(), len(found), str(path))


def own_scenes(spec: CheckedSpec, poses: object, on: object = None) -> SceneSet:
    """See `Spec.scenes`."""
    return _scenes(spec, _read_argument(spec, poses, on))


def _file(drawn: CheckedSpec, path: Path, *, partly: bool = False) -> _GivenScenes:
    """What a file of poses alone says; `partly`, of some of its objects, and perhaps of others. Raises DataError."""
    if path.suffix.lower() == ".json":
        raw, _ = parse(read_bytes(path, "a scenes file", limit=MAX_JSON_BYTES, remedy=REMEDY), str(path))
        if isinstance(raw, dict) and isinstance(raw.get("scenes"), list):
            raw = raw["scenes"]
        return _read_list(drawn, raw if isinstance(raw, list) else [raw], str(path), partly=partly)
    table = read_table(path, "a scenes file", NOT_SCENES)
    if "poses" in table.names:
        return _read_list(drawn, list(table.cells("poses")), str(path), partly=partly)
    if any(name in table.names for name in drawn.objects):
        rows = [dict(zip(table.names, row, strict=True)) for row in zip(*map(table.cells, table.names), strict=True)]
        return _read_list(drawn, rows, str(path), partly=partly)
    return _read_columns(drawn, table)


def settled_scenes(path: Path) -> SceneSet:
    """The scenes of a file of `scenegen settle`, as they came to rest. Raises DataError."""
    said, rest, on = read_settled(path)
    spec = said.spec.checked_spec
    if list(spec.objects) != said.objects:
        facts = {"wanted": tuple(spec.objects), "found": tuple(said.objects)}
        raise DataError(OTHER_SPEC(reason="the objects of the file are not those of its spec", **facts))
    if not len(rest):
        raise RequestError(NO_SCENES())
    header = make_header(spec, {"method": "settled", **said.simulator.model_dump()}, RequestData(phi={}, n=len(rest)))
    poses = upright(rest)
    poses[np.isnan(rest[..., 0])] = math.nan
    for one in header.choosers:
        if one.name not in said.surfaces:  # of earlier versions
            raise DataError(NO_SURFACE_GIVEN(name=one.name))
    surfaces = on if header.choosers else None
    bare = SceneSet(poses, {}, header, on=surfaces)
    return SceneSet(poses, evaluate(spec, bare), header, on=surfaces, rest=rest, trusted=True)


def part_of_scenes(spec: CheckedSpec, path: Path, names: Sequence[str]) -> Array:
    """(n, N, 3): the poses of a file of scenes, or of poses alone, of some of the spec's objects; NaN for the others,
    and for headings that it does not have. Of `names` alone, if there are some. Raises DataError, RequestError."""
    for name in names:
        if name not in spec.objects:
            raise RequestError(UNKNOWN_OBJECT(name=name, known=spec.objects))
    if is_plain(path):
        given = _file(spec, path, partly=True)
        poses = np.full((given.count, len(spec.objects), len(NAMES)), math.nan)
        for index, name in enumerate(spec.objects):
            for place, axis in enumerate(NAMES):
                poses[:, index, place] = given.columns.get(f"{name}.{axis}", math.nan)
    else:
        found = read_scenes(path)
        found.refuse_rest(path)
        known = {name: k for k, name in enumerate(found.objects)}
        poses = np.full((len(found), len(spec.objects), len(NAMES)), math.nan)
        for index, name in enumerate(spec.objects):
            if name in known:
                poses[:, index] = found.poses[:, known[name]]
    for name in names:
        if np.isnan(poses[:, spec.objects.index(name), X]).all():
            raise DataError(TABLE_COLUMN(file=path, name=f"{name}.x", known=[]))
    others = [k for k, name in enumerate(spec.objects) if names and name not in names]
    poses[:, others] = math.nan
    if np.isnan(poses).all():
        facts = {"wanted": tuple(spec.objects), "found": ()}
        raise DataError(OTHER_SPEC(reason=f"{path} has none of the spec's objects", **facts))
    return poses


def _scenes(spec: CheckedSpec, given: _GivenScenes) -> SceneSet:
    if not given.count:
        raise RequestError(NO_SCENES())
    header = make_header(spec, {"method": "poses from elsewhere"}, RequestData(phi={}, n=given.count))
    spare = {f"{one.name}[{k}]" for one in header.counts for k in range(one.least + 1, one.most + 1)}
    spare |= {f"{one.name}:{asset}" for one in header.counts for asset in one.assets}
    poses = np.empty((given.count, len(spec.objects), len(NAMES)))
    missing: list[str] = []
    for index, name in enumerate(spec.objects):
        each = [given.columns.get(f"{name}.{axis}") for axis in NAMES]
        for place, (axis, values) in enumerate(zip(NAMES, each, strict=True)):
            if values is None and name in spare and all(one is None for one in each):
                values = np.full(given.count, math.nan)
            if values is None and index in spec.fixed and place < len(spec.fixed[index]):
                values = np.full(given.count, spec.fixed[index][place])
            if values is None:
                missing.append(f"{name}.{axis}")
                continue
            bad = np.isinf(values) if name in spare else ~np.isfinite(values)
            if bad.any():
                facts = {"column": f"{name}.{axis}", "scene": int(bad.argmax()) + 1}
                raise DataError(COLUMN_NOT_A_NUMBER(path=given.name, own=True, **facts))
            poses[:, index, place] = values
    if missing:
        facts = {"missing": missing if len(missing) > 1 else None, "known": [*given.columns, *given.unused]}
        raise DataError(TABLE_COLUMN(file=given.name, name=missing[0], **facts))
    on = _surfaces(header, given)
    if header.counts:
        rows = as_rows(poses) if on is None else np.concatenate([as_rows(poses), on.T])
        try:
            counts_in(header, rows)
        except ValueError as error:
            raise DataError(NUMBERS_DISAGREE(file=given.name, scene=str(error))) from None
    notes = tuple(doubts_of(given.name, spec.objects, poses, spec.workspace))
    if given.unused:
        notes = (*notes, TABLE_UNUSED(file=given.name, columns=list(given.unused)))
    bare = SceneSet(poses, {}, header, on=on)
    return SceneSet(poses, evaluate(spec, bare), header, notes, on=on, trusted=True)


def _surfaces(header: SceneFile, given: _GivenScenes) -> Array | None:
    """(n, M): on which of its surfaces each chooser stands, counted from 1. Raises DataError."""
    if not header.choosers:
        return None
    found = np.empty((given.count, len(header.choosers)))
    for column, one in enumerate(header.choosers):
        said = given.on.get(f"{one.name}.{ON_COLUMN}")
        if said is None:
            raise DataError(NO_SURFACE_GIVEN(name=one.name))
        found[:, column] = [_surface(one, cell, number) for number, cell in enumerate(said, 1)]
    return found


def _surface(chooser: ObjectData, said: Any, number: int) -> float:
    assert chooser.support is not None
    names = [one.on for one in chooser.support.any]
    if said is None or (said == "" and "" not in names) or (isinstance(said, float) and math.isnan(said)):
        return math.nan
    # an object's name alone means its .inside or .top, as in a spec
    alone = [name for name in names if isinstance(said, str) and name in (said, f"{said}.inside", f"{said}.top")]
    if len(alone) == 1:
        return 1.0 + names.index(alone[0])
    try:
        place = float(said)
    except (TypeError, ValueError):
        place = 0.0
    if place not in range(1, len(names) + 1):
        raise DataError(OTHER_SURFACE(scene=f"scene {number}", name=chooser.name, surface=said, known=names))
    return place


def _read_argument(spec: CheckedSpec, poses: Any, on: Any) -> _GivenScenes:
    """What an argument says. Raises RequestError for what says no poses."""
    if hasattr(poses, "columns") and not isinstance(poses, Mapping):  # a data frame, of pandas or polars
        try:
            poses = {str(name): poses[name] for name in poses.columns}
        except TypeError:  # of pyarrow, or lazy
            raise _poses_error(spec, poses) from None
    if isinstance(poses, Mapping):
        if any("." in str(name) for name in poses):
            columns = {str(name): _array(values) for name, values in poses.items() if _is_place(spec, str(name))}
            sizes = {len(one) for one in columns.values()}
            if len(sizes) != 1 or any(one.ndim != 1 for one in columns.values()):
                raise _poses_error(spec, poses)
            more = {str(name): list(values) for name, values in poses.items() if str(name).endswith(f".{ON_COLUMN}")}
            return _GivenScenes("`poses`", sizes.pop(), columns, more if on is None else _numbers(spec, on))
        _refuse_unknown(spec, poses)
        each = {name: _array(_tuple(value)) for name, value in poses.items()}
        each = {name: one[None] if one.ndim == 1 else one for name, one in each.items()}
        sizes = {len(one) for one in each.values() if one.ndim == 2 and one.shape[1] == len(NAMES)}
        if len(sizes) != 1 or any(one.ndim != 2 or one.shape[1] != len(NAMES) for one in each.values()):
            raise _poses_error(spec, poses)
        columns = {f"{name}.{axis}": one[:, k] for name, one in each.items() for k, axis in enumerate(NAMES)}
        said = {f"{name}.{ON_COLUMN}": [value.on] for name, value in poses.items() if hasattr(value, ON_COLUMN)}
        return _GivenScenes("`poses`", sizes.pop(), columns, said if on is None else _numbers(spec, on))
    if isinstance(poses, Sequence) and not isinstance(poses, str) and poses and isinstance(poses[0], Mapping):
        return _read_list(spec, list(poses), "`poses`")
    array = _array(poses)
    if array.ndim == 2:
        array = array[None]
    if array.shape[1:] != (len(spec.objects), len(NAMES)):
        raise _poses_error(spec, poses)
    columns = {
        f"{name}.{axis}": array[:, index, k] for index, name in enumerate(spec.objects) for k, axis in enumerate(NAMES)
    }
    return _GivenScenes("`poses`", len(array), columns, _numbers(spec, on))


def _read_list(spec: CheckedSpec, scenes: list[Any], name: str, *, partly: bool = False) -> _GivenScenes:
    """A list of scenes, each with poses by name: {"x": .., "y": .., "theta": ..} or [x, y, theta]. `partly`: objects of
    other specs may be among them."""
    columns = {f"{one}.{axis}": np.full(len(scenes), math.nan) for one in spec.objects for axis in NAMES}
    on: dict[str, list[Any]] = {}
    for number, scene in enumerate(scenes):
        said = scene.get("poses", scene) if isinstance(scene, Mapping) else None
        if not isinstance(said, Mapping) or not said:
            raise DataError(not_scenes(name, f"scene {number + 1} has no poses by name"))
        if not partly:
            _refuse_unknown(spec, said)
        for thing, pose in said.items():
            if thing not in spec.objects:
                continue
            if isinstance(pose, Mapping):
                values = [pose.get(axis) for axis in NAMES]
                if ON_COLUMN in pose:
                    on.setdefault(f"{thing}.{ON_COLUMN}", [None] * len(scenes))[number] = pose[ON_COLUMN]
            else:
                values = list(_tuple(pose)) if isinstance(pose, Sequence | Pose) and not isinstance(pose, str) else []
            for axis, value in zip(NAMES, values, strict=len(values) == len(NAMES)):
                if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < math.inf:
                    column = f"{thing}.{axis}"
                    raise DataError(COLUMN_NOT_A_NUMBER(path=name, column=column, scene=number + 1, own=True))
                columns[f"{thing}.{axis}"][number] = value
            if len(values) != len(NAMES):
                raise DataError(not_scenes(name, f"scene {number + 1} has no x, y and theta of `{thing}`"))
    for index in () if partly else spec.fixed:  # what the spec holds can be left out, scene by scene
        for axis, value in zip(NAMES, spec.fixed[index], strict=False):
            held = columns[f"{spec.objects[index]}.{axis}"]
            held[np.isnan(held)] = value
    known = {column: values for column, values in columns.items() if not np.isnan(values).all()}
    return _GivenScenes(name, len(scenes), known, on)


def _read_columns(spec: CheckedSpec, table: Table) -> _GivenScenes:
    """A table with the columns mug.x, mug.y, mug.theta of each object."""
    places = [f"{name}.{axis}" for name in spec.objects for axis in NAMES]
    columns = {name: table.column(name, holes=True) for name in places if name in table.names}
    on = {name: list(table.cells(name)) for name in _choosers(spec) if name in table.names}
    unused = [name for name in table.names if name and not _is_place(spec, name) and not name.endswith(f".{ON_COLUMN}")]
    return _GivenScenes(table.file, len(table), columns, on, tuple(unused))


def _is_place(spec: CheckedSpec, column: str) -> bool:
    name, _, axis = column.rpartition(".")
    return name in spec.objects and axis in NAMES


def _choosers(spec: CheckedSpec) -> list[str]:
    """The columns that say on what things stand that may be on several surfaces."""
    return [f"{spec.objects[index]}.{ON_COLUMN}" for index, choice in spec.choices.items() if len(choice.options) > 1]


def _numbers(spec: CheckedSpec, on: Any) -> dict[str, Sequence[Any]]:
    """Columns of an array (n, M), as `SceneSet.on` has them."""
    names = _choosers(spec)
    if on is None:
        return {}
    array = _array(on)
    if array.ndim == 1:
        array = array[None]
    if array.ndim != 2 or array.shape[1] != len(names):
        raise RequestError(WRONG_VALUE(argument="on", value=repr(on)[:80], wanted=f"an array (n, {len(names)})"))
    return dict(zip(names, array.T.tolist(), strict=True))


def _tuple(pose: Any) -> Any:
    return (pose.x, pose.y, pose.theta) if isinstance(pose, Pose) else pose


def _array(values: Any) -> Array:
    """Of numpy, torch, pandas, polars and lists. NaN where no numbers stand."""
    try:
        return as_numbers(values)
    except (TypeError, ValueError):
        return np.full((1,) * 4, math.nan)


def _poses_error(spec: CheckedSpec, poses: Any) -> RequestError:
    shape = tuple(getattr(poses, "shape", ()))
    kind = f", {poses.dtype}" if hasattr(poses, "dtype") else ""
    value = f"of the shape {shape}{kind}" if shape else repr(poses)[:80]
    return RequestError(WRONG_VALUE(argument="poses", value=value, wanted=WANTED % len(spec.objects)))


def _refuse_unknown(spec: CheckedSpec, names: Mapping[Any, Any]) -> None:
    odd = sorted(str(name) for name in names if name not in spec.objects)
    if odd:
        facts = {"wanted": tuple(spec.objects), "found": tuple(map(str, names))}
        raise DataError(OTHER_SPEC(reason=f"the spec does not know `{odd[0]}`", **facts))
