"""A scene file as a world for simulators: forms, masses, colours and heights of its objects, and their table."""

from __future__ import annotations

import io
import math
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from scenegen.errors import DataError
from scenegen.errors.files import NO_VOLUME, OFF_THE_TABLE
from scenegen.geometry import Box, Circle, Footprint, Polygon
from scenegen.geometry.footprint import Rectangle, clipped, signed_area
from scenegen.geometry.workspace import BOARD, LARGEST
from scenegen.lang.checker import check_text
from scenegen.lang.spec import Region
from scenegen.pose import as_poses, flat, row_count
from scenegen.scenes.blocks import Block, counts_in, member_of
from scenegen.scenes.data import RegionData, SceneFile, ShapeData, check_sizes, footprint_of
from scenegen.scenes.stage import heights_of
from scenegen.things import ASSETS, PLAIN, UNKNOWN, Shape, colors_of, parts_of
from scenegen.things.bodies import DENSITY, collision_of, friction_of, mass_of
from scenegen.things.colored_mesh import ColoredMesh
from scenegen.things.mesh import Floats, Mesh
from scenegen.things.palette import LINEN, RGB, of_regions, rgb_of
from scenegen.things.surfaces import base_heights
from scenegen.worlds.export.world import (
    LEAST_MASS,
    WOODEN,
    Body,
    BodyForm,
    Paint,
    Patch,
    Record,
    World,
    inertia,
    piece_of,
)
from scenegen.worlds.export.xml import check_names, printable

if TYPE_CHECKING:
    from scenegen.worlds.own_body import OwnBody


# --------------------------------------------------------------------------------------------------------------------
# Pictures on objects from files of one's own, as simulators take them: PNG, and places from the lower edge.


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


MARGIN = 0.07  # metres of table beyond what is on it
FARTHEST = 100.0  # maximum extent of a table beyond the workspace, in metres
SHEET = 0.0004  # metres: the thickness of the first region
WIDE = 2.0 * LARGEST  # metres: the largest circle of the language; only outlines of corners can be larger
DRAWN = 32  # corners of a round region
Own: TypeAlias = "Mapping[str, OwnBody]"  # by the objects' names
NOTHING: Own = {}
LEAST_SHEET = 1e-9  # square metres: smaller parts of a region are left out


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


def recorded(world: World, header: SceneFile, scenes: Block, labels: Sequence[str]) -> World:
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
    return replace(world, record=Record(header.spec.source, phi, counts, assets, everything))


def _bodies(header: SceneFile, own: Own) -> tuple[Body, ...]:
    spec = check_text(header.spec.source, "the spec of the scenes")
    fixed = {spec.objects[index] for index in spec.fixed}
    return bodies_of([one.name for one in header.objects], [_shape(one.shape) for one in header.objects], fixed, own)


def world_of(header: SceneFile, scenes: Block, own: Own = NOTHING) -> World:
    """The world of a scene file's header and (some of) its scenes, which have the same objects. `own` has the bodies of
    objects, by name, that are from files of one's own; without it these are prisms over their outlines.

    Raises DataError if an object is too far from the table, SpecError if the header's spec is damaged.
    """
    names = [one.name for one in header.objects]
    check_names(names)
    check_sizes(header, WIDE)
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
    usual = colors_of([(name, shape.asset) for name, shape in zip(names, shapes, strict=True)])
    colors = [rgb_of(shape.color) if shape.color else one for shape, one in zip(shapes, usual, strict=True)]
    shapes = [replace(shape, color="") for shape in shapes]  # those of one size share a mesh, whatever their colours
    forms = _forms(names, shapes, own)
    return tuple(
        Body(
            name,
            forms[shape, own.get(name)],
            _colors(shape, color, own.get(name)),
            max(_mass(shape, own.get(name)), LEAST_MASS),
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
                raise DataError(NO_VOLUME(name=name)) from None
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
    return [(x + cos * u - sin * v, y + sin * u + cos * v) for u, v in _outline(footprint)]


def _patches(regions: Sequence[RegionData], table: Rectangle) -> tuple[Patch, ...]:
    """The regions as sheets, clipped at the table."""
    patches: list[Patch] = []
    for region, color in zip(regions, of_regions([region.name for region in regions]), strict=True):
        pose = (region.pose.x, region.pose.y, region.pose.theta)
        lying = clipped(_corners(footprint_of(region.footprint), pose), table)
        if len(lying) >= 3 and signed_area(lying) > LEAST_SHEET:
            top = region.height
            sheet = min(BOARD, top) if top else SHEET * (1.0 + 0.25 * len(patches))
            patches.append(Patch(lying, color, sheet, top))
    return tuple(patches)


def _outline(footprint: Footprint) -> Sequence[tuple[float, float]]:
    match footprint:
        case Circle(radius):
            turns = [k * math.tau / DRAWN for k in range(DRAWN)]
            return [(radius * math.cos(turn), radius * math.sin(turn)) for turn in turns]
        case Box(length, width):
            x, y = length / 2.0, width / 2.0
            return [(-x, -y), (x, -y), (x, y), (-x, y)]
        case Polygon(vertices):
            return vertices


def _table(header: SceneFile, shapes: Sequence[Shape], names: Sequence[str], places: Floats) -> Rectangle:
    """The workspace, extended to contain all objects. Raises DataError if that is too far."""
    (x0, x1), (y0, y1) = header.workspace.x, header.workspace.y
    least, most = np.array([x0, y0]), np.array([x1, y1])
    for shape, name, place in zip(shapes, names, np.moveaxis(places, 1, 0), strict=True):
        if not len(place):
            continue
        away = np.maximum(place[:, :2] - (x1, y1), (x0, y0) - place[:, :2]).max(axis=1)
        if away.max() > FARTHEST:
            facts = {"distance": away.max(), "scene": int(away.argmax()) + 1, "limit": FARTHEST}
            raise DataError(OFF_THE_TABLE(name=name, **facts))
        reach = max(math.hypot(u, v) for u, v in _outline(shape.footprint))
        least = np.minimum(least, place[:, :2].min(axis=0) - reach)
        most = np.maximum(most, place[:, :2].max(axis=0) + reach)
    (left, front), (right, back) = (least - MARGIN).tolist(), (most + MARGIN).tolist()
    return left, front, right, back
