"""Scenes for simulators: bodies with mass, friction and convex pieces, on a table with legs; made from a scene file.

One world is used for all scenes of a file: they share the objects and differ in the poses. Metres, kilograms, radians;
the table's top is z = 0, as in pictures.
"""

from __future__ import annotations

import io
import itertools
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from scenegen.errors import DataError
from scenegen.errors.files import NO_WORLD
from scenegen.geometry import Footprint
from scenegen.geometry.footprint import Rectangle, clip, signed_area
from scenegen.geometry.workspace import BOARD, LARGEST
from scenegen.lang.spec import Region
from scenegen.pose import as_poses, flat, row_count
from scenegen.scenes.blocks import Block, counts_in, member_of
from scenegen.scenes.data import RegionData, SceneFile, ShapeData, check_sizes, footprint_of, heights_of
from scenegen.things import ASSETS, PLAIN, UNKNOWN, Shape
from scenegen.things.bodies import DENSITY, collision_of, friction_of, mass_of, parts_of
from scenegen.things.colored_mesh import ColoredMesh
from scenegen.things.library import RGB
from scenegen.things.mesh import Mesh, prism
from scenegen.things.outline import Floats, corners_of
from scenegen.things.palette import LINEN, object_colors, parse_rgb, region_colors
from scenegen.things.surfaces import base_heights
from scenegen.worlds.export.xml import check_names, printable

if TYPE_CHECKING:
    from scenegen.worlds.export.looks import SceneLook, SceneLooks
    from scenegen.worlds.own_body import OwnBody

TEXTURES = "textures"

MIN_VOLUME = 1e-19  # cubic metres


@dataclass(frozen=True, slots=True)
class Inertia:
    """For one kilogram: `center` (3,) in metres, and `moments` (3, 3) about it, in m^2, along the object's axes."""

    center: Floats
    moments: Floats


def inertia(meshes: Sequence[Mesh]) -> Inertia:
    """The inertia of closed meshes of one density; overlaps count twice. Raises ValueError if there is no volume.

    A tetrahedron from the origin to a triangle (a, b, c) has the volume det/6, the first moment det/24 (a + b + c) and
    the second det/120 (s s' + a a' + b b' + c c') with s = a + b + c; those of a mesh are their sums. The origin is
    moved to the middle of the corners, to avoid cancellation.
    """
    middle = np.concatenate([mesh.vertices for mesh in meshes]).mean(axis=0)
    volume, first, second = 0.0, np.zeros(3), np.zeros((3, 3))
    for mesh in meshes:
        corners = (mesh.vertices - middle)[mesh.faces]
        det = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
        total = corners.sum(axis=1)
        volume += float(det.sum()) / 6.0
        first += det @ total / 24.0
        second += (
            np.einsum("t,ti,tj->ij", det, total, total) + np.einsum("t,tki,tkj->ij", det, corners, corners)
        ) / 120
    if not volume > MIN_VOLUME:
        raise ValueError("a solid without volume")
    center = first / volume
    spread = second / volume - np.outer(center, center)
    moments = np.trace(spread) * np.eye(3) - spread
    # Values that are zero up to rounding are set to zero, so files do not depend on a machine's order of summation.
    size = math.sqrt(float(np.trace(moments)))
    return Inertia(_clean(center + middle, size), _clean(moments, size**2))


def _clean(values: Floats, size: float) -> Floats:
    return np.where(np.abs(values) < 1e-9 * size, 0.0, values)


Quaternion = tuple[float, float, float, float]  # w, x, y, z
NO_TURN: Quaternion = (1.0, 0.0, 0.0, 0.0)


def principal(moments: Floats) -> tuple[tuple[float, float, float], Quaternion]:
    """The principal moments of a symmetric matrix (3, 3), and the rotation from their axes to the matrix's, as USD has
    the inertia of a body.

    Of the 24 rotations that do it, the one closest to none: a matrix that is diagonal keeps its axes.
    """
    if not (moments - np.diag(np.diag(moments))).any():
        xx, yy, zz = np.diag(moments).tolist()
        return (xx, yy, zz), NO_TURN
    values, vectors = np.linalg.eigh(moments)
    best, closest = -math.inf, np.eye(3)
    order: tuple[int, ...] = (0, 1, 2)
    for tried in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            turn = vectors[:, tried] * np.array(signs)
            near = round(float(np.trace(turn)), 9)  # ties are not decided by rounding
            if np.linalg.det(turn) > 0.0 and near > best:
                best, closest, order = near, turn, tried
    a, b, c = values[list(order)].tolist()
    return (a, b, c), _quaternion(closest)


def _quaternion(turn: Floats) -> Quaternion:
    """Of a rotation by less than 63 degrees, the most that `principal` needs."""
    w = math.sqrt(1.0 + float(np.trace(turn))) / 2.0
    x, y, z = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    return w, float(x / (4.0 * w)), float(y / (4.0 * w)), float(z / (4.0 * w))


THICK, LEG, TALL = 0.03, 0.05, 0.72  # metres: the table top, its legs' width, its height above the floor
MIN_BODY_MASS, MIN_MOMENT = 1e-6, 1e-12  # kg and kg m^2: MuJoCo treats less as zero
MIN_MOMENT_RATIO = 1e-6  # minimum ratio of the smallest moment to the largest: less would be lost to rounding
WOODEN: RGB = (0.80, 0.68, 0.53)


@dataclass(frozen=True, slots=True)
class ConvexPiece:
    """A convex collision piece; `box` is (middle, sizes) of one that is a box along its object's axes."""

    mesh: Mesh
    box: tuple[list[float], list[float]] | None


@dataclass(frozen=True, slots=True, eq=False)
class Paint:
    """A picture on a part, which its colour is multiplied with: the bytes of a `png` file, and where in it each vertex
    is, `places` (V, 2), v = 0 the lower edge."""

    png: bytes
    places: Floats


@dataclass(frozen=True, slots=True)
class BodyForm:
    """The data that objects of one shape share. `name` is part of file names; `parts` are drawn, the convex `pieces`
    collide. In the object's frame: the middle of its footprint at the origin, z = 0 its lowest point, heading along
    x. `paints` are those of the parts, by their numbers from 1; `shells` says that parts need not enclose a volume."""

    name: str
    parts: tuple[Mesh, ...]
    pieces: tuple[ConvexPiece, ...]
    inertia: Inertia
    paints: dict[int, Paint] = field(default_factory=dict)
    shells: bool = False


@dataclass(frozen=True, slots=True)
class Body:
    """An object: `colors` has one entry for each part of its form; a fixed one never moves."""

    name: str
    form: BodyForm
    colors: tuple[RGB, ...]
    mass: float
    friction: float
    fixed: bool

    @property
    def moments(self) -> Floats:
        """(3, 3): moments of inertia about the centre of mass, in kg m^2; for specks and needles the least that
        simulators can handle."""
        moments = self.mass * self.form.inertia.moments
        least, _, most = np.linalg.eigvalsh(moments).tolist()
        lacking: float = max(MIN_MOMENT, MIN_MOMENT_RATIO * most) - least
        return np.asarray(moments + max(lacking, 0.0) * np.eye(3))


@dataclass(frozen=True, slots=True)
class Patch:
    """A region of the spec: its corners (x, y) on the table. It is a thin, purely visual sheet, whose thickness in
    metres differs between regions, so that overlapping ones can be distinguished; at a height, the `top`, a solid
    board."""

    corners: tuple[tuple[float, float], ...]
    color: RGB
    thickness: float
    top: float = 0.0

    @property
    def solid(self) -> bool:
        return self.top > 0.0

    def mesh(self) -> Mesh:
        """The sheet or board, in the world's frame."""
        return prism(self.corners, *((self.top - self.thickness, self.top) if self.solid else (0.0, self.thickness)))


@dataclass(frozen=True, slots=True, eq=False)
class SpecRecord:
    """What a scene file says of a world's scenes beside poses: the text of their `spec`, `phi` (scenes,) by label, the
    numbers of things and the assets of categories, which all its scenes share, and the names of `everything` that its
    scenes can have."""

    spec: str
    phi: dict[str, Floats]
    counts: dict[str, int]
    assets: dict[str, str]
    everything: tuple[str, ...]


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """`table` is (x lowest, y lowest, x highest, y highest); `poses` (scenes, bodies, 4) are x, y, z and theta of the
    bodies' frames, z from the objects below them; `rest` (scenes, bodies, 7) are places and quaternions, w first, of
    scenes that came to rest in a simulator. `numbers` are the scenes' in their file, where not all of it is here.
    `record` is for formats that hold it; `dressing` has the looks of all scenes of the file.
    """

    title: str
    bodies: tuple[Body, ...]
    patches: tuple[Patch, ...]
    table: tuple[float, float, float, float]
    poses: Floats
    numbers: tuple[int, ...] = ()
    rest: Floats | None = None
    record: SpecRecord | None = None
    dressing: SceneLooks | None = None

    def tinted_bodies(self, dressed: SceneLook | None) -> tuple[Body, ...]:
        """The bodies in the colours of a look."""
        tints = {} if dressed is None else {tint.name: tint for tint in dressed.look.tints}
        return tuple(
            replace(body, colors=tuple(map(tints[body.name], body.colors))) if body.name in tints else body
            for body in self.bodies
        )

    @property
    def scenes(self) -> tuple[int, ...]:
        """The number of each scene, from 1."""
        return self.numbers or tuple(range(1, len(self.poses) + 1))

    def places(self, index: int) -> list[tuple[float, ...]]:
        """x, y, z, qw, qx, qy, qz of each body in a scene, counted from 0."""
        if self.rest is not None:
            return [tuple(place) for place in self.rest[index].tolist()]
        return [
            (x, y, z, math.cos(theta / 2.0), 0.0, 0.0, math.sin(theta / 2.0))
            for x, y, z, theta in self.poses[index].tolist()
        ]

    @property
    def forms(self) -> tuple[BodyForm, ...]:
        """Every form once, in the order of the bodies."""
        return tuple({body.form.name: body.form for body in self.bodies}.values())

    @property
    def boards(self) -> tuple[Patch, ...]:
        """The regions at heights, on which bodies stand."""
        return tuple(patch for patch in self.patches if patch.solid)

    def free_name(self, wish: str) -> str:
        """A name that no object has: `wish`, if necessary with underscores."""
        taken = {body.name for body in self.bodies}
        while wish in taken:
            wish += "_"
        return wish

    def slabs(self) -> tuple[tuple[tuple[float, float, float], tuple[float, float, float]], ...]:
        """The table as boxes (middle, sizes): the top, then the legs."""
        x0, y0, x1, y1 = self.table
        top = ((x0 + x1) / 2, (y0 + y1) / 2, -THICK / 2), (x1 - x0, y1 - y0, THICK)
        inset, long = LEG, TALL - THICK
        legs = [
            ((x, y, -THICK - long / 2), (LEG, LEG, long))
            for x in (x0 + inset, x1 - inset)
            for y in (y0 + inset, y1 - inset)
        ]
        return top, *legs


def piece_of(mesh: Mesh) -> ConvexPiece:
    """The collision piece of a convex mesh: a box if the mesh fills its bounding box."""
    least, most = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    full = float(np.prod(most - least))
    box = ((least + most) / 2).tolist(), (most - least).tolist()
    return ConvexPiece(mesh, None if mesh.volume < full * (1.0 - 1e-6) else box)


def paints_of(skins: Sequence[ColoredMesh]) -> dict[int, Paint]:
    """By the number of the surface, from 1; for those with a texture."""
    found: dict[int, Paint] = {}
    files: dict[bytes, bytes] = {}
    for number, skin in enumerate(skins, start=1):
        if skin.texture and skin.uv is not None:
            if skin.texture not in files:
                files[skin.texture] = _without_alpha(skin.texture)
            found[number] = Paint(files[skin.texture], np.column_stack([skin.uv[:, 0], 1.0 - skin.uv[:, 1]]))
    return found


def _without_alpha(data: bytes) -> bytes:
    """MuJoCo reads no JPEG. Transparency is left out."""
    from PIL import Image  # only objects with textures need it

    out = io.BytesIO()
    with Image.open(io.BytesIO(data)) as picture:
        picture.convert("RGB").save(out, "PNG")
    return out.getvalue()


WORLD_MARGIN = 0.07  # metres of table beyond what is on it
MAX_TABLE_REACH = 100.0  # maximum extent of a table beyond the workspace, in metres
SHEET = 0.0004  # metres: the thickness of the first region
MAX_OUTLINE_SIZE = 2.0 * LARGEST  # metres: the largest circle of the language; only outlines of corners can be larger
ROUND_CORNERS = 32  # corners of a round region
Own: TypeAlias = "Mapping[str, OwnBody]"  # by the objects' names
NOTHING: Own = {}
MIN_SHEET_AREA = 1e-9  # square metres: smaller parts of a region are left out


def worlds_of(header: SceneFile, scenes: Block, own: Own = NOTHING) -> Iterator[World]:
    """The worlds of a scene file: one, or one for all scenes with the same numbers of things. `own` and what is raised
    as in `world_of`."""
    if not header.counts:
        yield world_of(header, scenes, own)
        return
    whole = {one.name: one for one in _bodies(header, own)}
    found = counts_in(header, scenes.rows)
    for numbers in np.unique(found, axis=1).T:
        mine = np.flatnonzero((found == numbers[:, None]).all(axis=0))
        member = member_of(header, dict(zip((one.name for one in header.counts), numbers.tolist(), strict=True)))
        rows = scenes.rows[np.ix_(~np.isnan(scenes.rows[:, mine[0]]), mine)]
        world = world_of(member, Block(rows, scenes.phi[:, mine]), own)
        bodies = tuple(whole[one.name] for one in member.objects)  # of the same colours in all scenes
        yield replace(world, bodies=bodies, numbers=tuple((mine + 1).tolist()))


def with_record(world: World, header: SceneFile, scenes: Block, labels: Sequence[str]) -> World:
    """A world of `worlds_of` with what the file says of its scenes; `labels` are those of the block's phi."""
    mine = np.array(world.scenes) - 1
    phi = dict(zip(labels, scenes.phi[:, mine], strict=True))
    counts: dict[str, int] = {}
    assets: dict[str, str] = {}
    if header.counts:
        numbers = counts_in(header, scenes.rows[:, mine[:1]])[:, 0].tolist()
        for one, number in zip(header.counts, numbers, strict=True):
            if one.assets:
                assets[one.name] = one.assets[number - 1]
            else:
                counts[one.name] = number
    everything = tuple(one.name for one in header.objects)
    return replace(world, record=SpecRecord(header.spec.source, phi, counts, assets, everything))


def _bodies(header: SceneFile, own: Own) -> tuple[Body, ...]:
    spec = header.spec.checked_spec
    fixed = {spec.objects[index] for index in spec.fixed}
    return bodies_of([one.name for one in header.objects], [_shape(one.shape) for one in header.objects], fixed, own)


def world_of(header: SceneFile, scenes: Block, own: Own = NOTHING) -> World:
    """The world of a scene file's header and (some of) its scenes, which have the same objects. `own` has the bodies of
    objects, by name, that are from files of one's own; without it these are prisms over their outlines.

    Raises DataError if an object is too far from the table, SpecError if the header's spec is damaged.
    """
    names = [one.name for one in header.objects]
    check_names(names)
    check_sizes(header, MAX_OUTLINE_SIZE)
    shapes = [_shape(one.shape) for one in header.objects]
    bodies = _bodies(header, own)
    rows = scenes.rows[: row_count(len(names))]
    places = np.ascontiguousarray(flat(as_poses(rows)))
    table = _table(header, shapes, names, places)
    heights = base_heights(shapes, places, declared=heights_of(header, scenes.rows[len(rows) :].T))
    poses = np.concatenate([places[..., :2], heights[..., None], np.remainder(places[..., 2:], math.tau)], axis=-1)
    return World(printable(header.spec.title), bodies, _patches(header.regions, table), table, poses)


def bodies_of(
    names: Sequence[str], shapes: Sequence[Shape], fixed: Collection[str], own: Own = NOTHING
) -> tuple[Body, ...]:
    """The bodies of objects; those named in `fixed` cannot be moved, and those in `own` are drawn as their skins or,
    without these, as their convex pieces. Raises DataError for one without a volume."""
    usual = object_colors([(name, shape.asset) for name, shape in zip(names, shapes, strict=True)])
    colors = [parse_rgb(shape.color) if shape.color else one for shape, one in zip(shapes, usual, strict=True)]
    shapes = [replace(shape, color="") for shape in shapes]  # those of one size share a mesh, whatever their colours
    forms = _forms(names, shapes, own)
    return tuple(
        Body(
            name,
            forms[shape, own.get(name)],
            _colors(shape, color, own.get(name)),
            max(_mass(shape, own.get(name)), MIN_BODY_MASS),
            _friction(shape, own.get(name)),
            name in fixed,
        )
        for name, shape, color in zip(names, shapes, colors, strict=True)
    )


def _colors(shape: Shape, color: RGB, own: OwnBody | None) -> tuple[RGB, ...]:
    if own is not None and own.skins:
        return tuple(skin.color or color for skin in own.skins)
    return tuple(part.color for part in parts_of(shape, color)) if own is None else (color,) * len(own.pieces)


def _mass(shape: Shape, own: OwnBody | None) -> float:
    """Kilograms: what its file says, else of wood that fills its convex pieces."""
    if own is None:
        return mass_of(shape)
    return DENSITY * sum(piece.volume for piece in own.pieces) if own.mass is None else own.mass


def _friction(shape: Shape, own: OwnBody | None) -> float:
    return friction_of(shape) if own is None or own.friction is None else own.friction


def _shape(data: ShapeData) -> Shape:
    asset = data.asset if data.asset in ASSETS or data.asset in PLAIN else UNKNOWN
    return Shape(asset, footprint_of(data.footprint), data.height, open=tuple(data.open), color=data.color)


def _forms(names: Sequence[str], shapes: Sequence[Shape], own: Own) -> dict[tuple[Shape, OwnBody | None], BodyForm]:
    forms: dict[tuple[Shape, OwnBody | None], BodyForm] = {}
    for name, shape in zip(names, shapes, strict=True):
        mine = own.get(name)
        if (shape, mine) not in forms:
            same = sum(other.asset == shape.asset for other, _ in forms)
            solids = collision_of(shape) if mine is None else mine.pieces
            pieces = tuple(piece_of(solid) for solid in solids)
            skins = () if mine is None else mine.skins
            parts = tuple(part.mesh for part in parts_of(shape, WOODEN)) if mine is None else solids
            parts = tuple(Mesh(skin.vertices, skin.faces) for skin in skins) or parts
            try:
                mass = inertia(solids)
            except ValueError:
                raise DataError(NO_WORLD(name=name)) from None
            form = f"{shape.asset}{same + 1 if same else ''}"
            forms[shape, mine] = BodyForm(form, parts, pieces, mass, paints_of(skins), bool(skins))
    return forms


def boards_of(regions: Sequence[Region]) -> tuple[Patch, ...]:
    """The boards of a spec: its regions at heights."""
    boards = []
    for region in regions:
        if region.height:
            corners = tuple(_corners(region.footprint, region.pose))
            boards.append(Patch(corners, LINEN, min(BOARD, region.height), region.height))
    return tuple(boards)


def _corners(footprint: Footprint, pose: tuple[float, float, float]) -> list[tuple[float, float]]:
    x, y, theta = pose
    cos, sin = math.cos(theta), math.sin(theta)
    return [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in corners_of(footprint, ROUND_CORNERS)]


def _patches(regions: Sequence[RegionData], table: Rectangle) -> tuple[Patch, ...]:
    """The regions as sheets, clipped at the table."""
    patches: list[Patch] = []
    for region, color in zip(regions, region_colors([region.name for region in regions]), strict=True):
        pose = (region.pose.x, region.pose.y, region.pose.theta)
        lying = clip(_corners(footprint_of(region.footprint), pose), table)
        if len(lying) >= 3 and signed_area(lying) > MIN_SHEET_AREA:
            top = region.height
            sheet = min(BOARD, top) if top else SHEET * (1.0 + 0.25 * len(patches))
            patches.append(Patch(lying, color, sheet, top))
    return tuple(patches)


def _table(header: SceneFile, shapes: Sequence[Shape], names: Sequence[str], places: Floats) -> Rectangle:
    """The workspace, extended to contain all objects. Raises DataError if that is too far."""
    (x0, x1), (y0, y1) = header.workspace.x, header.workspace.y
    least, most = np.array([x0, y0]), np.array([x1, y1])
    for shape, name, place in zip(shapes, names, np.moveaxis(places, 1, 0), strict=True):
        if not len(place):
            continue
        away = np.maximum(place[:, :2] - (x1, y1), (x0, y0) - place[:, :2]).max(axis=1)
        if away.max() > MAX_TABLE_REACH:
            facts = {"distance": away.max(), "scene": int(away.argmax()) + 1, "limit": MAX_TABLE_REACH}
            raise DataError(NO_WORLD(name=name, **facts))
        reach = max(math.hypot(u, v) for u, v in corners_of(shape.footprint, ROUND_CORNERS))
        least = np.minimum(least, place[:, :2].min(axis=0) - reach)
        most = np.maximum(most, place[:, :2].max(axis=0) + reach)
    (left, front), (right, back) = (least - WORLD_MARGIN).tolist(), (most + WORLD_MARGIN).tolist()
    return left, front, right, back
