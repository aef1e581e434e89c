"""What files say of a spec's scenes, and scenes as the rows of a core: the way from one to the other and back."""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.lang.spec import CheckedSpec, chosen
from scenegen.needs import need
from scenegen.pose import SIZE, THETA, X, Y, row_count, row_of
from scenegen.scenes.data import (
    RAISED,
    VERSION,
    CountData,
    ObjectData,
    Pose,
    RegionData,
    RequestData,
    SceneFile,
    ShapeData,
    SpecRef,
    SupportData,
    SurfaceData,
    WorkspaceData,
    footprint_data,
    footprint_of,
    heights_of,
)
from scenegen.things import ASSETS, PLAIN, UNKNOWN, Shape
from scenegen.things.surfaces import base_heights

if TYPE_CHECKING:
    from scenegen.sampling.problem import Problem
    from scenegen.scenes.motions import MotionFile, MotionRequestData, TimeData


def make_header(spec: CheckedSpec, sampler: Mapping[str, object], request: RequestData) -> SceneFile:
    """A scene file without scenes. It is not validated: a spec that was checked has nothing that a file cannot say."""
    return SceneFile.model_construct(
        spec=SpecRef(source=spec.source, sha256=spec.sha256, title=spec.title),
        workspace=WorkspaceData(x=spec.workspace.x, y=spec.workspace.y),
        version=RAISED if spec.declares_heights else VERSION,
        objects=[
            ObjectData(name=name, shape=_shape_data(shape), support=_support_data(spec, which))
            for which, (name, shape) in enumerate(zip(spec.objects, spec.shapes, strict=True))
        ],
        counts=[
            CountData(name=one.name, least=one.least, most=one.most, assets=list(one.assets)) for one in spec.counts
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


def stored_rows(spec: CheckedSpec, rows: Array) -> Array:
    """Rows of the core as files hold them: those of the objects, and for each choice the number of the surface."""
    if not spec.choices:
        return rows
    count = row_count(len(spec.objects))
    on = [
        np.where(np.isnan(rows[row_of(one.switch, X)]), np.nan, chosen(one, rows) + 1.0)
        for one in spec.choices.values()
    ]
    return np.concatenate([rows[:count], on])


# --------------------------------------------------------------------------------------------------------------------
# What files hold of a problem's scenes, or motions.


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


# --------------------------------------------------------------------------------------------------------------------
# Poses as simulators take them: a place and a quaternion.


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
