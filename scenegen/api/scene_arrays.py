"""Scenes of one spec as arrays: what is done with sets of scenes is done with these."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.requests import OUT_OF_PLACE, UNKNOWN_CHOICE
from scenegen.geometry.workspace import wrap_headings
from scenegen.lang.spec import CheckedSpec, chosen_options
from scenegen.needs import need
from scenegen.pose import SIZE, THETA, X, Y, as_rows, row_count, row_of
from scenegen.scenes.arrange import check_held, order_of, refuse_numbers, reorder, with_switches
from scenegen.scenes.blocks import BLOCK, Block, member_of, numbers_in
from scenegen.scenes.data import (
    SCENES_VERSION,
    VERSION_WITH_HEIGHTS,
    CountData,
    ObjectData,
    Pose,
    RegionData,
    RequestData,
    SceneData,
    SceneFile,
    ShapeData,
    SpecRef,
    SupportData,
    SurfaceData,
    WorkspaceData,
    footprint_data,
    footprint_of,
    heights_of,
    pose_of,
)
from scenegen.scenes.formats import registry
from scenegen.things import ASSETS, PLAIN, UNKNOWN, Shape
from scenegen.things.surfaces import base_heights
from scenegen.validation import as_path

if TYPE_CHECKING:
    import torch

    from scenegen.sampling.problem import Problem
    from scenegen.scenes.motions import MotionFile, MotionRequestData, TimeData


MAX_NAMED_OBJECTS = 10  # objects that a set names when it speaks of itself


@dataclass(frozen=True, slots=True, eq=False)
class SceneArrays:
    """Scenes of one spec, as the leaves know them: pictures and exports are the methods of `SceneSet`.

    `poses` is (n, N, 3): x and y in metres, theta in radians, objects in the order of `objects`. `phi` maps each label
    to (n,) values in float64. `header` is the scene file without its scenes. `on` (n, M) says for each of the M objects
    that stand on one of several surfaces (`header.choosers`) on which, counted from 1; None where there are none.
    `rest` (n, N, 7) has place and quaternion, x, y, z, qw, qx, qy, qz, of objects that came to rest in a simulator;
    then `poses` are x, y and the heading of the nearest upright attitude. None for scenes as they are planned.
    """

    poses: Array
    phi: Mapping[str, Array]
    header: SceneFile
    warnings: tuple[Diagnostic, ...] = field(default=())
    on: Array | None = field(default=None, kw_only=True)
    rest: Array | None = field(default=None, kw_only=True)

    def __len__(self) -> int:
        return int(self.poses.shape[0])

    @property
    def objects(self) -> tuple[str, ...]:
        return tuple(one.name for one in self.header.objects)

    @property
    def counts(self) -> dict[str, npt.NDArray[np.intp]]:
        """How many things there are, (n,) by array of objects, where that is drawn: others have NaN in `poses`. Of an
        object of a category the number of its asset, from 1."""
        if not self.header.counts:
            return {}
        numbers = numbers_in(self.objects, self.header.counts, self.present)
        return {one.name: number for one, number in zip(self.header.counts, numbers, strict=True)}

    @property
    def assets(self) -> dict[str, list[str]]:
        """Which asset it is in each scene, by object of a category."""
        known = {one.name: one.assets for one in self.header.counts if one.assets}
        return {name: [known[name][k - 1] for k in each] for name, each in self.counts.items() if name in known}

    @property
    def present(self) -> npt.NDArray[np.bool_]:
        """(n, N): which objects are there."""
        return ~np.isnan(self.poses[:, :, X])

    def parts(self) -> Iterator[tuple[dict[str, int], npt.NDArray[np.intp]]]:
        """The numbers of things that there are, in lexicographic order, and the scenes that have them."""
        counts = self.counts
        if not counts:
            yield {}, np.arange(len(self))
            return
        table = np.array(list(counts.values())).reshape(len(counts), len(self))
        for numbers in np.unique(table, axis=1).T:
            mine = np.flatnonzero((table == numbers[:, None]).all(axis=0))
            yield dict(zip(counts, numbers.tolist(), strict=True)), mine

    def only(self, numbers: Mapping[str, int], which: npt.NDArray[np.intp]) -> SceneArrays:
        """Scenes that all have these numbers of things, as a set of scenes in which no number is drawn."""
        header = member_of(self.header, numbers)
        here = {one.name for one in header.objects}
        placed = [column for column, name in enumerate(self.objects) if name in here]
        chosen = [column for column, one in enumerate(self.header.choosers) if one.name in here]
        return SceneArrays(
            self.poses[which[:, None], placed],
            {name: values[which] for name, values in self.phi.items()},
            header,
            on=None if self.on is None else self.on[which[:, None], chosen],
            rest=None if self.rest is None else self.rest[which[:, None], placed],
        )

    def names(self) -> str:
        """The first objects in words."""
        more = len(self.objects) - MAX_NAMED_OBJECTS
        return ", ".join(self.objects[:MAX_NAMED_OBJECTS]) + (f" and {more} more" if more > 0 else "")

    def places(self, index: int) -> tuple[dict[str, Pose], dict[str, float]]:
        """The poses of one scene by object, and its phi by label. Raises IndexError."""
        choosers = {} if self.on is None else {one.name: one for one in self.header.choosers}
        on = {} if self.on is None else dict(zip(choosers, self.on[index].tolist(), strict=True))
        poses = {
            name: pose_of(choosers.get(name), tuple(pose), on.get(name, 0.0))
            for name, pose in zip(self.objects, self.poses[index].tolist(), strict=True)
            if not math.isnan(pose[0])
        }
        return poses, {name: float(values[index]) for name, values in self.phi.items()}

    def file(self) -> SceneFile:
        """The scene file: validated data, ready to be written."""
        if not len(self):
            return self.header.without_scenes(tuple(self.phi))
        counts = self.counts
        scenes = [
            SceneData(poses=poses, phi=phi, counts={name: int(each[number]) for name, each in counts.items()} or None)
            for number, (poses, phi) in enumerate(map(self.places, range(len(self))))
        ]
        return self.header.model_copy(update={"scenes": scenes})

    def save(self, path: str | Path) -> Path:
        """Write the scenes, as .json, .jsonl or .parquet by the path's ending; the file appears whole or not at all."""
        path = as_path("path", path)
        self.refuse_rest(path)
        registry.write_scenes(path, self.header, tuple(self.phi), self.blocks())
        return path

    def refuse_rest(self, what: object) -> None:
        """Raises RequestError for scenes that came to rest in a simulator."""
        if self.rest is not None:
            rule = "takes scenes as they are planned, and these came to rest in a simulator, at any height and attitude"
            remedy = "`scenegen eval`, `render` and `export` to mjcf, sdf and usd take them"
            raise RequestError(OUT_OF_PLACE(option=what, rule=rule, remedy=remedy))

    def blocks(self) -> Iterator[Block]:
        """The scenes as file formats take them."""
        for start in range(0, len(self), BLOCK):
            part = slice(start, start + BLOCK)
            rows = as_rows(self.poses[part])
            if self.on is not None:
                rows = np.concatenate([rows, self.on[part].T])
            phi = np.array([values[part] for values in self.phi.values()]).reshape(len(self.phi), rows.shape[1])
            yield Block(rows, phi)

    def to_numpy(self) -> tuple[Array, Array]:
        """Copies: poses (n, N, 3) in metres and radians, and phi (n, L), labels in the order of `phi`, in float64."""
        phi = np.empty((len(self), len(self.phi)))
        for column, values in enumerate(self.phi.values()):
            phi[:, column] = values
        return self.poses.copy(), phi

    def to_torch(
        self, dtype: torch.dtype | None = None, device: torch.device | str | None = None
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """The same as tensors, what `spec.robustness()` takes and gives; float64 unless `dtype` says otherwise."""
        need("torch", "for `to_torch()`")
        import torch

        poses, phi = (torch.from_numpy(array) for array in self.to_numpy())
        return poses.to(device, dtype), phi.to(device, dtype)

    def poses7(self, *, tensor: bool = False, dtype: str = "float64") -> Any:
        """(n, N, 7): x, y, z of each object's lowest point under the middle of its footprint, in metres, and its
        attitude as a quaternion qw, qx, qy, qz. Heights are those of pictures and of files for simulators.

        A numpy array, or a torch `tensor`, in float32 or float64. Raises RequestError for another dtype, and where
        torch is not installed.
        """
        return poses7(self.header, self.poses, self.on, self.rest, tensor=tensor, dtype=dtype)


def make_header(spec: CheckedSpec, sampler: Mapping[str, object], request: RequestData) -> SceneFile:
    """A scene file without scenes. It is not validated: a spec that was checked has nothing that a file cannot say."""
    return SceneFile.model_construct(
        spec=SpecRef(source=spec.source, sha256=spec.sha256, title=spec.title),
        workspace=WorkspaceData(x=spec.workspace.x, y=spec.workspace.y),
        version=VERSION_WITH_HEIGHTS if spec.declares_heights else SCENES_VERSION,
        objects=[
            ObjectData(name=name, shape=_shape_data(shape), support=_support_data(spec, which))
            for which, (name, shape) in enumerate(zip(spec.objects, spec.shapes, strict=True))
        ],
        counts=[
            CountData(name=one.name, least=one.least, most=one.most, assets=list(one.assets), values=list(one.values))
            for one in spec.counts
        ],
        regions=[
            RegionData(
                name=region.name,
                footprint=footprint_data(region.footprint),
                pose=Pose(x=region.pose[0], y=region.pose[1], theta=region.pose[2]),
                height=region.height,
            )
            for region in spec.regions
        ],
        sampler=dict(sampler),
        request=request,
        scenes=[],
    )


def motion_header(
    spec: CheckedSpec, sampler: Mapping[str, object], request: MotionRequestData, time: TimeData
) -> MotionFile:
    """A motion file without motions."""
    from scenegen.scenes.motions import MotionFile

    like = make_header(spec, sampler, RequestData(phi={}, n=request.n))
    return MotionFile(
        spec=like.spec, workspace=like.workspace, objects=like.objects, counts=like.counts, regions=like.regions,
        sampler=like.sampler, time=time, request=request, motions=[],
    )  # fmt: skip


def _support_data(spec: CheckedSpec, which: int) -> SupportData | None:
    if not spec.declares_heights:
        return None
    height, under = spec.heights[which], spec.supports.get(which)
    options = spec.choices[which].options if which in spec.choices else () if under is None else (under,)
    if height is not None and len(options) < 2:
        return SupportData(z=height, on="" if under is None else under.name)
    return SupportData(
        any=[
            SurfaceData(on=one.name, rise=one.height, carrier="" if one.carrier is None else spec.objects[one.carrier])
            for one in options
        ]
    )


def _shape_data(shape: Shape) -> ShapeData:
    return ShapeData(
        asset=shape.asset,
        footprint=footprint_data(shape.footprint),
        height=shape.height,
        path=shape.path,
        open=list(shape.open),
        color=shape.color,
    )


@dataclass(frozen=True, slots=True, eq=False)
class SpecScenes:
    """The scenes of a set that one ordinary spec is of: `which` they are, and their `rows` in the order of its core."""

    spec: CheckedSpec
    which: npt.NDArray[np.intp]
    rows: Array


def parts_of(spec: CheckedSpec, scenes: SceneArrays) -> Iterator[SpecScenes]:
    """The scenes by the ordinary spec that they are of: the spec, or members of it where it draws how many things there
    are. Raises DataError as `rows_of` does."""
    for numbers, which in scenes.parts():
        some = scenes.only(numbers, which) if numbers else scenes
        found = (one for one in spec.members if set(one.objects) == set(some.objects))
        mine = next(found, spec)
        yield SpecScenes(mine, which, rows_of(mine, some))


def rows_of(spec: CheckedSpec, scenes: SceneArrays) -> Array:
    """The poses as (3N, n) storage in the spec's order of objects, headings in [0, 2 pi).

    Raises DataError for scenes of other objects, and where an object that the spec holds in place stands elsewhere.
    """
    refuse_numbers(scenes.header, "this")
    stored = as_rows(scenes.poses)
    rows = wrap_headings(reorder(stored, order_of(spec, scenes.objects)))
    check_held(spec, rows)
    return with_switches(spec, scenes.header, rows, scenes.on)


def stored_rows(spec: CheckedSpec, rows: Array) -> Array:
    """Rows of the core as files hold them: those of the objects, and for each choice the number of the surface."""
    if not spec.choices:
        return rows
    count = row_count(len(spec.objects))
    on = [
        np.where(np.isnan(rows[row_of(one.switch, X)]), np.nan, chosen_options(one, rows) + 1.0)
        for one in spec.choices.values()
    ]
    return np.concatenate([rows[:count], on])


def header_of(problem: Problem, sampler: Mapping[str, object]) -> Any:
    """The file of a problem's scenes, or motions, without these; `sampler` says how they were drawn."""
    request = problem.request
    phi = {label: (one.low, one.high) for label, one in request.phi.items()}
    if not problem.over_time:
        return make_header(problem.spec, sampler, RequestData(phi=phi, n=request.n, spread=cast("Any", request.spread)))
    from scenegen.scenes.motions import MotionRequestData, TimeData

    timed = problem.spec.timed
    assert timed is not None
    time = TimeData(steps=timed.horizon.steps, dt=timed.horizon.dt)
    return motion_header(problem.spec, sampler, MotionRequestData(phi=phi, n=request.n), time)


def stored_form(problem: Problem) -> Callable[[Array], Array] | None:
    """What makes of a plan's rows those that files hold; None where these are the same. It can be pickled."""
    spec = problem.spec
    if problem.over_time:
        assert spec.timed is not None
        return functools.partial(_stored_motions, len(spec.objects), spec.timed.horizon.steps)
    return functools.partial(stored_rows, spec) if spec.choices else None


def _stored_motions(objects: int, steps: int, rows: Array) -> Array:
    """The poses of motions, without the movers, and their facts."""
    from scenegen.scenes.formats.motions import facts_of

    places = rows[: len(rows) - steps]
    poses = places.reshape(objects, SIZE, steps + 1, rows.shape[1]).transpose(3, 2, 0, 1)
    return np.concatenate([places, *(one[None] for one in facts_of(np.ascontiguousarray(poses)).values())])


DTYPES = ("float32", "float64")


def poses7(
    header: SceneFile,
    poses: npt.NDArray[np.float64],
    on: npt.NDArray[np.float64] | None,
    rest: npt.NDArray[np.float64] | None = None,
    *,
    tensor: bool,
    dtype: str,
) -> Any:
    """(n, N, 7) of poses (n, N, 3): x, y, z, qw, qx, qy, qz; `on` and `rest` as SceneSet has them. Raises
    RequestError."""
    if dtype not in DTYPES:
        raise RequestError(UNKNOWN_CHOICE(what="dtype", name=dtype, known=DTYPES))
    shapes = [
        Shape(
            one.shape.asset if one.shape.asset in {*ASSETS, *PLAIN} else UNKNOWN,
            footprint_of(one.shape.footprint),
            one.shape.height,
            open=tuple(one.shape.open),
        )
        for one in header.objects
    ]
    found = np.zeros((*poses.shape[:2], 7))
    found[..., 0], found[..., 1] = poses[..., X], poses[..., Y]
    found[..., 2] = base_heights(
        shapes, poses, declared=heights_of(header, np.empty((len(poses), 0)) if on is None else on)
    )
    found[..., 3], found[..., 6] = np.cos(poses[..., THETA] / 2.0), np.sin(poses[..., THETA] / 2.0)
    found[np.isnan(poses[..., X])] = np.nan
    found = (found if rest is None else rest).astype(dtype)
    if not tensor:
        return found
    need("torch", "for tensors")
    from torch import from_numpy

    return from_numpy(found)
