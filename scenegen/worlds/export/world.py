"""Scenes for simulators: bodies with mass, friction and convex pieces, on a table with legs.

One world is used for all scenes of a file: they share the objects and differ in the poses. Metres, kilograms, radians;
the table's top is z = 0, as in pictures.
"""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

import numpy as np

from scenegen.errors import DataError
from scenegen.errors.files import NO_MODEL, UNUSABLE_BODY
from scenegen.scenes.data import SceneFile, ShapeData
from scenegen.scenes.own_files import is_read, own_file, reason_of
from scenegen.scenes.stage import PictureSetup
from scenegen.show.looks.camera import Camera
from scenegen.show.looks.look import Look, Point, looks_jsonl
from scenegen.show.looks.textures import PLAIN, WOOD, Pixels, image_of, mean_of, wood
from scenegen.things.colored_mesh import check_texture
from scenegen.things.mesh import Floats, Mesh, prism
from scenegen.things.meshfile import MeshError
from scenegen.things.palette import RGB
from scenegen.things.urdf import UrdfError
from scenegen.worlds.own_body import OwnBody, mesh_body, robot_body

# --------------------------------------------------------------------------------------------------------------------
# Looks for simulators: what the table, the ground and the walls of each scene are covered with, and its camera.


FOLDER = "textures"
SIDE = 1024  # pixels along the longer side of a wooden table
HIGH = 3.0  # metres: walls, from the floor

Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class TexturedColor:
    """A colour, and the file in `FOLDER` of the texture that multiplies it, if there is one: `width` and `height`
    metres of the surface, repeated, or where these are 0, all of it. `mean` is what it looks like from afar."""

    color: RGB
    mean: RGB
    file: str = ""
    width: float = 0.0
    height: float = 0.0

    def repeats(self, width: float, height: float) -> tuple[float, float]:
        """How often the texture is on a rectangle of these metres, from left to right and from its lower edge up."""
        return (width / self.width, height / self.height) if self.width else (1.0, 1.0)


@dataclass(frozen=True, slots=True)
class Wall:
    """A rectangle that is seen from one side: its middle, the directions of its width and height, of length 1, and
    both in metres."""

    middle: Point
    across: Point
    width: float
    height: float
    up: Point = (0.0, 0.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class SceneLook:
    """The look of one scene."""

    look: Look
    camera: Camera
    table: TexturedColor
    ground: TexturedColor
    walls: TexturedColor
    room: Rectangle | None

    def each_wall(self, floor: float, table: Rectangle) -> Iterator[Wall]:
        """The walls of the room, which stand at the height `floor`. Simulators let walls cast shadows, pictures do not:
        those on the side of the light are only so high that it shines on the whole `table`, whose top is z = 0."""
        if self.room is None:
            return
        x0, y0, x1, y1 = self.room
        across, along, _ = self.look.towards  # of the light, for each metre of height
        for at, inwards, width, gap, light in (
            (((x0 + x1) / 2.0, y1), (0.0, -1.0), x1 - x0, y1 - table[3], along),
            (((x0 + x1) / 2.0, y0), (0.0, 1.0), x1 - x0, table[1] - y0, -along),
            ((x0, (y0 + y1) / 2.0), (1.0, 0.0), y1 - y0, table[0] - x0, -across),
            ((x1, (y0 + y1) / 2.0), (-1.0, 0.0), y1 - y0, x1 - table[2], across),
        ):
            high = min(HIGH, max(gap, 0.0) / light - floor) if light > 0.0 else HIGH
            yield Wall((*at, floor + high / 2.0), (-inwards[1], inwards[0], 0.0), width, high)


class SceneLooks:
    """The looks of the scenes of a file. `cameras` are those of their view "look"; `stage` is the table of pictures;
    `files` are those of textures, by name."""

    def __init__(
        self,
        looks: Sequence[Look],
        cameras: Sequence[Camera],
        stage: PictureSetup,
        files: Mapping[str, bytes],
        seed: int,
    ) -> None:
        self._looks, self._cameras, self._stage, self._seed = looks, cameras, stage, seed
        self._files = files
        used = dict.fromkeys(name for look in looks for name in look.textures if name not in (PLAIN, WOOD))
        self._names = _file_names(list(used))
        images = {name: image_of(name, files) for name in used}
        self._ratios = {name: image.shape[0] / image.shape[1] for name, image in images.items()}
        self._means = {name: mean_of(image) for name, image in images.items()}
        self._wooden: dict[Rectangle, str] = {}  # tables, and the files of their wood

    def of(self, scene: int, table: Rectangle) -> SceneLook:
        """The look of a scene, by its number from 1, with the simulator's table (x lowest, y lowest, x highest, y
        highest)."""
        look, camera = self._looks[scene - 1], self._cameras[scene - 1]
        if look.table_texture == WOOD:
            file = self._wooden.setdefault(table, f"{WOOD}_{len(self._wooden) + 1}.png")
            top = TexturedColor(look.table, look.table, file)
        else:
            top = self._covering(look.table, look.table_texture, look.table_texture_size)
        room = look.room(self._stage.table, camera.eye)
        seen = PLAIN if room is None else look.walls_texture  # which is not among `textures` without walls
        return SceneLook(
            look,
            camera,
            top,
            self._covering(look.ground_color, look.ground_texture, look.ground_texture_size),
            self._covering(look.walls_color, seen, look.walls_texture_size),
            room,
        )

    def textures(self) -> Iterator[tuple[str, bytes]]:
        """The files of the textures that scenes were given: name, PNG."""
        for name, file in self._names.items():
            yield file, _encoded(image_of(name, self._files))
        for table, file in self._wooden.items():
            yield file, _encoded(_wood(self._stage, table))

    def record(self, files: Sequence[str]) -> bytes:
        """`looks.jsonl` for scenes in these files."""
        return looks_jsonl(self._looks, self._seed, [("file", name) for name in files], self._cameras)

    def _covering(self, color: RGB, texture: str, size: float) -> TexturedColor:
        if texture == PLAIN:
            return TexturedColor(color, color)
        red, green, blue = (one * share for one, share in zip(color, self._means[texture], strict=True))
        return TexturedColor(color, (red, green, blue), self._names[texture], size, size * self._ratios[texture])


def _file_names(textures: Sequence[str]) -> dict[str, str]:
    """A file name for each texture, no two alike, whatever the case of letters."""
    names: dict[str, str] = {}
    used = set[str]()
    for texture in textures:
        stem = "".join(one if one.isascii() and one.isalnum() else "_" for one in PurePosixPath(texture).stem)
        stem = stem or "texture"
        name, number = stem, 1
        while name.lower() in used:
            number += 1
            name = f"{stem}_{number}"
        used.add(name.lower())
        names[texture] = f"{name}.png"
    return names


def _encoded(image: Pixels) -> bytes:
    from PIL import Image

    out = io.BytesIO()
    Image.fromarray(image).save(out, format="PNG")
    return out.getvalue()


def _wood(stage: PictureSetup, table: Rectangle) -> Pixels:
    """(h, w, 3): the wood of a whole table, from above."""
    x0, y0, x1, y1 = table
    pixel = max(x1 - x0, y1 - y0) / SIDE
    across, along = (max(round(length / pixel), 1) for length in (x1 - x0, y1 - y0))
    x = x0 + (np.arange(across) + 0.5) / across * (x1 - x0)
    y = y1 - (np.arange(along) + 0.5) / along * (y1 - y0)
    columns, rows = np.meshgrid(x, y)
    sizes = np.full(columns.size, pixel), np.full(columns.size, pixel)
    shares = wood(stage, columns.ravel(), rows.ravel(), sizes, inlay=False).reshape(along, across, 3)
    return np.rint(255.0 * np.clip(shares, 0.0, 1.0)).astype(np.uint8)


# --------------------------------------------------------------------------------------------------------------------
# The bodies of a scene file's objects that are from files of one's own, read again from these files.


def own_bodies_of(file: SceneFile, folder: Path, *, painted: bool = False) -> dict[str, OwnBody]:
    """By the objects' names, in the objects' frames (z = 0 the lowest point of the outline): the bodies of those whose
    shape is `mesh` or `asset` of a glTF, .obj, .stl or URDF file, or `urdf`. `folder` is where the spec lay; a file
    outside it is not read. With `painted`, they have what is drawn, with colours and textures, too. Objects from other
    mesh files have none, and collide as their outline.

    Raises DataError where a file cannot be read or cut into convex pieces, where it has another outline than the scenes
    were made with, and where no object has such a file, RequestError where CoACD is needed and not installed.
    """
    known: dict[str, OwnBody | None] = {}
    bodies: dict[str, OwnBody] = {}
    for item in file.objects:
        key = item.shape.model_dump_json()
        try:
            if key not in known:
                known[key] = _body(folder, item.shape, painted) if is_read(item.shape, folder) else None
        except (MeshError, UrdfError) as error:
            raise DataError(UNUSABLE_BODY(path=item.shape.path, name=item.name, reason=reason_of(error))) from None
        body = known[key]
        if body is not None:
            bodies[item.name] = body
    if not bodies:
        raise DataError(NO_MODEL())
    return bodies


def _body(folder: Path, shape: ShapeData, painted: bool) -> OwnBody:
    file = own_file(folder, shape)
    if file.is_robot:
        made = robot_body(file.data, file.beside, painted=painted).turned(file.matrix)
    else:
        made = mesh_body(file.path, file.data, file.beside, file.matrix, painted=painted)
    for texture in {one.texture for one in made.skins if one.texture} if painted else ():
        check_texture(texture, "a texture of it")
    mass = made.mass if file.mass is None else file.mass
    friction = made.friction if file.friction is None else file.friction
    return replace(made, mass=mass, friction=friction).moved(file.offset)


# --------------------------------------------------------------------------------------------------------------------
# Mass properties: centre and moments of closed meshes, by the divergence theorem.


LEAST = 1e-19  # cubic metres


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
    if not volume > LEAST:
        raise ValueError("a solid without volume")
    center = first / volume
    spread = second / volume - np.outer(center, center)
    moments = np.trace(spread) * np.eye(3) - spread
    # Values that are zero up to rounding are set to zero, so files do not depend on a machine's order of summation.
    size = math.sqrt(float(np.trace(moments)))
    return Inertia(_clean(center + middle, size), _clean(moments, size**2))


def _clean(values: Floats, size: float) -> Floats:
    return np.where(np.abs(values) < 1e-9 * size, 0.0, values)


THICK, LEG, TALL = 0.03, 0.05, 0.72  # metres: the table top, its legs' width, its height above the floor
LEAST_MASS, LEAST_MOMENT = 1e-6, 1e-12  # kg and kg m^2: MuJoCo treats less as zero
LEAST_SHARE = 1e-6  # minimum ratio of the smallest moment to the largest: less would be lost to rounding
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
        lacking: float = max(LEAST_MOMENT, LEAST_SHARE * most) - least
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
class Record:
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
    record: Record | None = None
    dressing: SceneLooks | None = None

    def colored(self, dressed: SceneLook | None) -> tuple[Body, ...]:
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
