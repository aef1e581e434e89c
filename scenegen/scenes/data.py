"""The scene file, as pydantic models: the one border that scene data crosses on its way in or out.

Format `scenegen/scenes`, versions 1 and 2 (objects that say how high they stand). The JSON Schema of `SceneFile` ships
in docs/ and a golden test holds it still.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from functools import cached_property, partial
from operator import is_, not_
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    FiniteFloat,
    SerializerFunctionWrapHandler,
    Tag,
    model_serializer,
    model_validator,
)

from scenegen.arrays import Array
from scenegen.errors import DataError
from scenegen.errors.files import OTHER_SURFACE, SIZE_IN_FILE
from scenegen.geometry import Box, Circle, Footprint, Polygon
from scenegen.geometry.footprint import is_convex, signed_area
from scenegen.geometry.workspace import MAX_COORDINATE, MAX_WORKSPACE_WIDTH, SMALLEST
from scenegen.pose import row_count

if TYPE_CHECKING:
    from scenegen.lang.spec import CheckedSpec

EndsData = tuple[FiniteFloat | None, FiniteFloat | None]
"""A range of phi in files: lowest and highest, null for an open end."""


class CountData(BaseModel):
    """An array of objects whose number of elements is drawn, from `least` to `most`, or one of those `values`: the
    file has an object for each that there can be, `block[1]` to `block[8]`. With `assets` it is an object of a
    category: the file has an object for each asset that can be drawn, `mug:red` and `mug:blue`, of which one is
    there in each scene, and the number says which, counted from 1."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)

    name: str
    least: Annotated[int, Field(ge=1)]
    most: Annotated[int, Field(ge=1)]
    assets: list[str] = Field(default_factory=list, exclude_if=not_)
    values: list[int] = Field(default_factory=list, exclude_if=not_)


def check_counts(counts: Sequence[CountData], objects: Collection[str]) -> None:
    """Raises ValueError for an array of which the file has not all elements, and for one that is counted twice."""
    for one in counts:
        enough = one.least < one.most <= len(objects)
        if one.assets:
            names = {f"{one.name}:{asset}" for asset in one.assets}
            if one.least != 1 or not 1 < one.most == len(names) == len(one.assets) or not names <= set(objects):
                raise ValueError(f"the objects are not those of the assets of {one.name}")
            continue
        if not enough or any(f"{one.name}[{number}]" not in objects for number in range(1, one.most + 1)):
            raise ValueError(f"there are not {one.least} to {one.most} objects of {one.name}")
        ends = [*one.values[:1], *one.values[-1:]]
        if one.values and (sorted({*one.values}) != one.values or ends != [one.least, one.most]):
            raise ValueError(f"the numbers listed of {one.name} are not in order from {one.least} to {one.most}")
    if len({one.name for one in counts}) < len(counts):
        raise ValueError("two of the counts are of the same array")


SCENES_FORMAT: Literal["scenegen/scenes"] = "scenegen/scenes"
SCENES_VERSION: Literal[1] = 1
VERSION_WITH_HEIGHTS: Literal[2] = 2  # the version of files whose objects say what they stand on

Bounds = tuple[FiniteFloat, FiniteFloat]


class _StrictSceneModel(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True, defer_build=True)


class Pose(_StrictSceneModel):
    """Where an object stands: its centre in metres, its heading in radians, counter-clockwise from the x axis."""

    x: FiniteFloat
    y: FiniteFloat
    theta: FiniteFloat


class RestingPose(Pose):
    """Likewise, of an object that stands on one of several surfaces: `on` says on which."""

    on: str


def _kind(value: object) -> str:
    """Which of the two a pose is, read or written: errors then name the fields of that one alone."""
    resting = "on" in value if isinstance(value, dict) else isinstance(value, RestingPose)
    return "resting" if resting else "pose"


AnyPose = Annotated[
    Annotated[RestingPose, Tag("resting")] | Annotated[Pose, Tag("pose")],
    Discriminator(_kind),
]


class SceneData(_StrictSceneModel):
    """One scene: a pose for each object, and the satisfaction value phi of each label in float64. Where the number of
    things is drawn, `counts` has it, and objects that are not there have no pose."""

    counts: dict[str, Annotated[int, Field(ge=1)]] | None = Field(default=None, exclude_if=not_)
    poses: dict[str, AnyPose]
    phi: dict[str, FiniteFloat]


class CircleFootprint(_StrictSceneModel):
    kind: Literal["circle"] = "circle"
    radius: Annotated[FiniteFloat, Field(gt=0)]


class BoxFootprint(_StrictSceneModel):
    """`length` along the object's heading, `width` across it, in metres."""

    kind: Literal["box"] = "box"
    length: Annotated[FiniteFloat, Field(gt=0)]
    width: Annotated[FiniteFloat, Field(gt=0)]


class PolygonFootprint(_StrictSceneModel):
    """A convex polygon: corners (x, y) in metres in the object's frame, counter-clockwise, x along its heading."""

    kind: Literal["polygon"] = "polygon"
    vertices: Annotated[list[tuple[FiniteFloat, FiniteFloat]], Field(min_length=3)]

    @model_validator(mode="after")
    def _convex(self) -> Self:
        if not is_convex(self.vertices) or signed_area(self.vertices) <= 0.0:
            raise ValueError("the corners are not those of a convex polygon, counter-clockwise")
        return self


FootprintData = Annotated[CircleFootprint | BoxFootprint | PolygonFootprint, Field(discriminator="kind")]


class ShapeData(_StrictSceneModel):
    """What an object looks like: footprint and height in metres, and an entry of the asset library, or one of `box`,
    `cylinder`, `prism`, `urdf`, `mesh` and `asset`; `path` is the file, or the name in an index, of the last three as
    the spec has it. `open`, of a `cabinet(...)` alone, has the share by which each drawer is open, the lowest first."""

    asset: str
    footprint: FootprintData
    height: Annotated[FiniteFloat, Field(gt=0)]
    path: str = ""
    open: Annotated[list[Annotated[FiniteFloat, Field(ge=0, le=1)]], Field(max_length=6)] = Field(
        default_factory=list, exclude_if=not_
    )
    color: str = Field("", pattern="^(#[0-9a-f]{6})?$", exclude_if=not_)  # of a plain shape, where the spec says it

    @model_validator(mode="after")
    def _drawers_of_a_cabinet(self) -> Self:
        if self.open and (self.asset != "cabinet" or self.footprint.kind != "box"):
            raise ValueError("only a cabinet with a box as its footprint has drawers that are open")
        return self


class RegionData(_StrictSceneModel):
    """A named part of the table at a fixed place; with a `height` above the table, in metres, the top of a board."""

    name: str
    footprint: FootprintData
    pose: Pose
    height: FiniteFloat = Field(0.0, ge=0, exclude_if=not_)


def footprint_data(footprint: Footprint) -> CircleFootprint | BoxFootprint | PolygonFootprint:
    """A footprint as scene files hold it."""
    match footprint:
        case Circle(radius):
            return CircleFootprint(radius=radius)
        case Box(length, width):
            return BoxFootprint(length=length, width=width)
        case Polygon(vertices):
            return PolygonFootprint(vertices=list(vertices))


def footprint_of(data: CircleFootprint | BoxFootprint | PolygonFootprint) -> Footprint:
    """The footprint that a scene file holds."""
    match data:
        case CircleFootprint():
            return Circle(data.radius)
        case BoxFootprint():
            return Box(data.length, data.width)
        case PolygonFootprint():
            return Polygon(tuple(data.vertices))


class SurfaceData(_StrictSceneModel):
    """What an object can stand on: a surface, a region, or the table, and how high that is above the lowest point of
    `carrier`, another object, or above the table (an empty text); metres."""

    on: str
    rise: FiniteFloat
    carrier: str = ""


class SupportData(_StrictSceneModel):
    """How high above the table an object's lowest point is in every scene, in metres, and what it stands on: a surface
    (`tray.inside`), a region, or the table (an empty text).

    Where the height is not the same in every scene there is no `z`. `any` then has what the object can stand on: of
    several surfaces the pose in each scene names one; of one surface it is the carrier that stands higher or lower.
    """

    z: FiniteFloat | None = None
    on: str = ""
    any: list[SurfaceData] = Field(default_factory=list)

    @model_validator(mode="after")
    def _one_of_both(self) -> Self:
        names = {one.on for one in self.any}
        if (self.z is None) != bool(self.any) or len(names) != len(self.any):
            raise ValueError("a support has a `z`, or different surfaces under `any`")
        return self

    @model_serializer(mode="wrap")
    def _what_there_is(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        data: dict[str, Any] = dump(self)
        for name in ("any",) if self.z is not None else ("z", "on"):
            data.pop(name)
        return data


class ObjectData(_StrictSceneModel):
    """`support` is in files of version 2 alone; in those of version 1 heights follow from the poses."""

    name: str
    shape: ShapeData
    support: SupportData | None = Field(default=None, exclude_if=not_)


def carried_first(objects: Sequence[ObjectData]) -> tuple[int, ...]:
    """The objects whose heights a choice decides, by their numbers, each after what can carry it. Raises ValueError
    where there is no such order."""
    place = {one.name: number for number, one in enumerate(objects)}
    left = {
        number: {surface.carrier for surface in one.support.any} - {""}
        for number, one in enumerate(objects)
        if one.support is not None and one.support.z is None
    }
    found: list[int] = []
    waiting = {one.name for number, one in enumerate(objects) if number in left}
    while left:
        free = [number for number, below in left.items() if not below & waiting]
        if not free or any(not left[number] <= place.keys() for number in free):
            raise ValueError("an object stands on itself, or on none of the file's objects")
        for number in free:
            del left[number]
        waiting -= {objects[number].name for number in free}
        found += free
    return tuple(found)


class SpecRef(_StrictSceneModel):
    """The spec's canonical text, the SHA-256 of that text in UTF-8, and the opening comment's first line, if any."""

    source: str
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    title: str = ""

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if hashlib.sha256(self.source.encode()).hexdigest() != self.sha256:
            raise ValueError("the spec's text does not have the checksum beside it")
        return self

    @cached_property
    def checked_spec(self) -> CheckedSpec:
        """The spec, parsed and checked when it is first asked for. Raises SpecError."""
        from scenegen.lang.checker import check_text

        return check_text(self.source, "the spec of the scenes")

    def __getstate__(self) -> dict[Any, Any]:
        """Other processes check it themselves, if they need it at all."""
        state = super().__getstate__()
        fields = {name: value for name, value in state["__dict__"].items() if name != "checked_spec"}
        return {**state, "__dict__": fields}


class WorkspaceData(_StrictSceneModel):
    x: Bounds
    y: Bounds


class RequestData(_StrictSceneModel):
    """What was asked for: a range [lowest, highest] per label (null is an open end), the count, the spread."""

    phi: dict[str, EndsData]
    n: Annotated[int, Field(ge=1)]
    spread: Literal["flat", "base", "even"] = "flat"


class SceneFile(_StrictSceneModel):
    """A set of scenes with everything needed to re-score and draw them.

    The labels are those of the scenes' phi; a file without scenes names them in `labels`, which no other file has. In a
    file with `counts` scenes differ in how many things there are.
    """

    format: Literal["scenegen/scenes"] = SCENES_FORMAT
    version: Literal[1, 2] = SCENES_VERSION
    spec: SpecRef
    workspace: WorkspaceData
    objects: list[ObjectData]
    counts: list[CountData] = Field(default_factory=list, exclude_if=not_)
    regions: list[RegionData] = Field(default_factory=list)
    sampler: dict[str, Any]
    request: RequestData
    labels: list[str] | None = Field(default=None, exclude_if=partial(is_, None))
    scenes: list[SceneData]

    @model_validator(mode="after")
    def _supports_by_version(self) -> Self:
        if any((one.support is None) != (self.version == SCENES_VERSION) for one in self.objects):
            raise ValueError("in version 2 every object has a `support`, in version 1 none")
        carried_first(self.objects)
        return self

    @model_validator(mode="after")
    def _counts_of_objects(self) -> Self:
        check_counts(self.counts, {one.name for one in self.objects})
        return self

    @property
    def choosers(self) -> tuple[ObjectData, ...]:
        """The objects that stand on one of several surfaces, another one in each scene."""
        return tuple(one for one in self.objects if one.support is not None and len(one.support.any) > 1)

    @property
    def coordinates(self) -> int:
        """How many numbers place the objects of a scene: those of their poses, and one for each choice of a surface,
        counted from 1."""
        return row_count(len(self.objects)) + len(self.choosers)

    @property
    def label_names(self) -> tuple[str, ...]:
        """The labels, in the order of the first scene."""
        return tuple(self.scenes[0].phi) if self.scenes else tuple(self.labels or ())

    def without_scenes(self, labels: Sequence[str] = ()) -> Self:
        """The header: as it stands before scenes, or, with `labels`, as it stands alone."""
        return self.model_copy(update={"scenes": [], "labels": list(labels) or None})


SETTLED_FORMAT: Literal["scenegen/settled"] = "scenegen/settled"

Positive = Annotated[FiniteFloat, Field(gt=0)]


class SimulatorData(_StrictSceneModel):
    """Where scenes were simulated, and for how many seconds."""

    name: str
    version: str
    seconds: Positive


class SettledHeader(_StrictSceneModel):
    """What holds for all scenes of the file: the spec, its objects and labels, the simulation, and how far an object
    may be moved (mm) or turned (degrees) in a scene that counts as settled. `surfaces` are those of each object that
    stands on one of several, in the order of their numbers; scenes say on which it was planned."""

    format: Literal["scenegen/settled"] = SETTLED_FORMAT
    version: Literal[1] = SCENES_VERSION
    spec: SpecRef
    objects: list[str]
    labels: list[str]
    simulator: SimulatorData
    max_shift_mm: Positive
    max_turn_deg: Positive
    surfaces: dict[str, list[str]] = Field(default_factory=dict, exclude_if=not_)


def check_sizes(header: SceneFile, largest: float = MAX_WORKSPACE_WIDTH) -> None:
    """Refuse what no spec can say: numbers beyond all measure, shapes without a volume, a workspace without an area;
    and objects that measure more than `largest` metres. Raises DataError."""
    (x0, x1), (y0, y1) = header.workspace.x, header.workspace.y
    least = min(x1 - x0, y1 - y0)
    if not least >= SMALLEST:
        size = least if least > 0.0 else None
        limits = f"give its x and y as [lowest, highest] in metres, {SMALLEST:g} m apart at least"
        raise DataError(SIZE_IN_FILE(what="the workspace", size=size, how="wide", limits=limits))
    places = [x0, x1, y0, y1]
    places += [value for region in header.regions for value in (region.pose.x, region.pose.y)]
    if max(map(abs, places)) > MAX_COORDINATE:
        facts = {"size": max(map(abs, places)), "how": "away", "limits": f"{MAX_COORDINATE:,.0f} m are the most"}
        raise DataError(SIZE_IN_FILE(what="the workspace or a region", **facts))
    for one in header.objects:
        lengths = *footprint_of(one.shape.footprint).extent, one.shape.height
        if not (min(lengths) >= SMALLEST and max(lengths) <= largest):
            size = min(lengths) if min(lengths) < SMALLEST else max(lengths)
            limits = f"sizes lie between {SMALLEST:g} and {largest:,.0f} m here"
            raise DataError(SIZE_IN_FILE(what=f"`{one.name}`", size=size, how="large", limits=limits))
    for region in header.regions:
        size = max(footprint_of(region.footprint).extent)
        if not size <= MAX_WORKSPACE_WIDTH:
            facts = {"size": size, "how": "large", "limits": f"{MAX_WORKSPACE_WIDTH:,.0f} m are the most"}
            raise DataError(SIZE_IN_FILE(what=f"the region `{region.name}`", **facts))


def varying(header: SceneFile) -> bool:
    """Whether some object stands higher in one scene than in another."""
    return any(one.support is not None and one.support.z is None for one in header.objects)


def heights_of(header: SceneFile, on: Array) -> Array | None:
    """How high above the table each object's lowest point is, in metres: (N,), or (n, N) where that is not the same in
    every scene; None where heights follow from the poses. `on` (n, M) says for each of the file's choosers on which of
    its surfaces it stands, counted from 1, and NaN of one that is not there."""
    if header.version != VERSION_WITH_HEIGHTS:
        return None
    supports = [one.support for one in header.objects]
    known = np.array([0.0 if one is None or one.z is None else one.z for one in supports])
    order = carried_first(header.objects)
    if not order:
        return known
    place = {one.name: number for number, one in enumerate(header.objects)}
    column = {one.name: number for number, one in enumerate(header.choosers)}
    found = np.tile(known, (len(on), 1))
    for which in order:
        name, support = header.objects[which].name, supports[which]
        assert support is not None
        levels = np.stack(
            [one.rise + (found[:, place[one.carrier]] if one.carrier else np.zeros(len(on))) for one in support.any]
        )
        chosen = (
            np.nan_to_num(on[:, column[name]], nan=1.0).astype(np.intp) - 1
            if name in column
            else np.zeros(len(on), dtype=np.intp)
        )
        found[:, which] = levels[chosen, np.arange(len(on))]
    return found


def chosen_surface(scene: str, chooser: ObjectData, pose: Pose) -> float:
    """On which of its surfaces an object stands, counted from 1. Raises DataError."""
    assert chooser.support is not None
    names = [one.on for one in chooser.support.any]
    found = pose.on if isinstance(pose, RestingPose) else ""
    if found not in names:
        raise DataError(OTHER_SURFACE(scene=scene, name=chooser.name, surface=found, known=names))
    return 1.0 + names.index(found)


def chosen_surfaces(header: SceneFile, scenes: list[SceneData]) -> Array:
    """(n, M): on which of its surfaces each chooser stands, counted from 1. Raises DataError."""
    choosers = header.choosers
    found = [
        [
            chosen_surface(f"scene {number}", one, scene.poses[one.name]) if one.name in scene.poses else np.nan
            for one in choosers
        ]
        for number, scene in enumerate(scenes, 1)
    ]
    return np.array(found, dtype=np.float64).reshape(len(scenes), len(choosers))


def pose_of(chooser: ObjectData | None, pose: tuple[float, float, float], on: float = 0.0) -> Pose:
    """The pose of an object, with the name of the surface that it stands on where that is one of several."""
    x, y, theta = pose
    if chooser is None:
        return Pose(x=x, y=y, theta=theta)
    assert chooser.support is not None
    return RestingPose(x=x, y=y, theta=theta, on=chooser.support.any[int(on) - 1].on)
