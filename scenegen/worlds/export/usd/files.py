"""Scenes as USD (https://openusd.org), with the physics of UsdPhysics.

A scene's file has `/Scene`, its default prim, with the table and every object, a rigid body of its own frame: in the
middle of its footprint at its lowest point. Objects refer to `meshes/NAME.usda`, where each form is once, with mass,
contacts, meshes that are drawn and convex pieces that collide; a scene adds places and colours. Objects that are held
in place are colliders without a body. What a user who refers to the scene has already is outside of the default prim,
in `/Environment`: gravity, lights, cameras and a floor.

Files of a scene each are text, to be read and compared. A file with all scenes has each as a variant of the set
`scene`: time samples would make rigid bodies follow an animation.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenegen.things.mesh import shaded
from scenegen.things.palette import RGB
from scenegen.worlds.export.usd.stage import Quaternion, UsdStage, principal
from scenegen.worlds.export.world import FOLDER, TALL, WOODEN, Body, BodyForm, SceneLook, TexturedColor, Wall, World
from scenegen.worlds.export.xml import check_room

# --------------------------------------------------------------------------------------------------------------------
# How USD files look: materials, lights and cameras.


MATERIALS, SHADER = "Looks", "surface"  # names of the prims
FOCUS, SHAPE = 24.0, 16.0 / 9.0  # mm; width to height of pictures
FIELD = 45.0  # degrees, from the lower edge of a picture to the upper
# Degrees about x and y. The sun is as bright as a new light in Isaac Sim; the other one brightens its shadows.
SUN, FILL = (3000.0, 25.0, -25.0), (1000.0, -35.0, 40.0)
ANGLE = 1.0  # degrees: the width of both
USUAL_SUN, USUAL_FILL = 0.46, 0.60  # intensity and ambient light of a look that are as bright as these


@dataclass(frozen=True, slots=True)
class UsdMaterial:
    """What a surface looks like: its colour, and how rough and metallic it is, from 0 to 1."""

    color: RGB
    roughness: float = 0.6
    metallic: float = 0.0


def materials(stage: UsdStage, root: str) -> str:
    """The place for the materials of what is below `root`."""
    place = f"{root}/{MATERIALS}"
    stage.scope(place)
    return place


def material(stage: UsdStage, root: str, name: str, look: UsdMaterial) -> None:
    """A material below `root`, for `cover`."""
    path = f"{root}/{MATERIALS}/{name}"
    values: dict[str, float | RGB] = {
        "diffuseColor": look.color,
        "roughness": look.roughness,
        "metallic": look.metallic,
    }
    stage.material(path, SHADER)
    stage.inputs(f"{path}/{SHADER}", values)


def cover(stage: UsdStage, root: str, part: str, name: str, color: RGB) -> None:
    """Give `part`, a mesh or box below `root`, a material of this colour."""
    stage.bind(part, f"{root}/{MATERIALS}/{name}")
    stage.tint(part, color)


def recolor(stage: UsdStage, root: str, part: str, name: str, color: RGB) -> None:
    """Another colour for a part and its material, which are in the file that `root` refers to."""
    stage.inputs(f"{root}/{MATERIALS}/{name}/{SHADER}", {"diffuseColor": color})
    stage.tint(part, color)


def covering(stage: UsdStage, root: str, name: str, what: TexturedColor) -> None:
    """A material below `root` for a rectangle of `cover_rectangle`."""
    material(stage, root, name, UsdMaterial(what.color))
    if what.file:
        stage.image(f"{root}/{MATERIALS}/{name}", SHADER, f"./{FOLDER}/{what.file}", what.color)


def cover_rectangle(stage: UsdStage, root: str, part: str, name: str, wall: Wall, what: TexturedColor) -> None:
    """A rectangle, with a material of `covering`."""
    across, up, middle = (np.array(one) for one in (wall.across, wall.up, wall.middle))
    sides = np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)]) / 2.0
    corners = middle + sides[:, :1] * wall.width * across + sides[:, 1:] * wall.height * up
    stage.quad(part, corners, (sides + 0.5) * what.repeats(wall.width, wall.height))
    cover(stage, root, part, name, what.mean)


def lights(stage: UsdStage, root: str, dressed: SceneLook | None) -> None:
    """A sun, and a weaker light from the other side."""
    if dressed is None:
        for name, (intensity, about_x, about_y) in (("sun", SUN), ("fill", FILL)):
            stage.light(f"{root}/{name}", intensity=intensity, angle=ANGLE, turns=(about_x, about_y, 0.0))
        return
    look = dressed.look
    x, y, z = look.towards
    # Turned about x and then y, what shines along -z shines along -towards.
    turns = (-math.degrees(math.atan2(y, math.hypot(x, z))), math.degrees(math.atan2(x, z)), 0.0)
    strength = SUN[0] * look.light_intensity / USUAL_SUN
    stage.light(f"{root}/sun", intensity=strength, angle=ANGLE, turns=turns, color=look.light_color)
    strength, about_x, about_y = FILL[0] * look.light_ambient / USUAL_FILL, *FILL[1:]
    stage.light(f"{root}/fill", intensity=strength, angle=ANGLE, turns=(about_x, about_y, 0.0), color=look.light_color)


def camera_of(stage: UsdStage, path: str, dressed: SceneLook) -> None:
    """The camera of a look."""
    width, height = dressed.camera.size
    high = 2.0 * FOCUS * math.tan(math.radians(dressed.look.camera_fov) / 2.0)
    stage.camera_by(path, dressed.camera.view, (FOCUS, high * width / height, high))


def cameras(stage: UsdStage, root: str, table: tuple[float, float, float, float]) -> None:
    """One above the table and one in front of it."""
    x0, y0, x1, y1 = table
    x, y, side = (x0 + x1) / 2.0, (y0 + y1) / 2.0, max(x1 - x0, y1 - y0)
    high = 2.0 * FOCUS * math.tan(math.radians(FIELD / 2.0))
    lens = (FOCUS, high * SHAPE, high)
    stage.camera(f"{root}/top", at=(x, y, 1.6 * side), turn=0.0, lens=lens)
    stage.camera(f"{root}/front", at=(x, y - 1.1 * side, 1.1 * side), turn=45.0, lens=lens)


# --------------------------------------------------------------------------------------------------------------------
# Names of prims: identifiers of USD, made from names of any kind.


# Newer versions of USD allow more letters; those of Isaac Sim before 5 do not.
_IDENTIFIER = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_OTHER = re.compile(r"[^A-Za-z0-9_]+")


def identifiers(names: Iterable[str]) -> dict[str, str]:
    """An identifier for each of different names, no two alike: the name itself if it is one, as `mug`, else the name
    with underscores, as `block_1` for `block[1]`, and a number where that is taken."""
    wanted = list(names)
    kept = {name for name in wanted if _IDENTIFIER.fullmatch(name)}
    used, found = set(kept), {}
    for name in wanted:
        found[name] = name if name in kept else free(_plain(name), used)
        used.add(found[name])
    return found


def free(wish: str, used: Collection[str]) -> str:
    """`wish`, or with the least number from 2 that makes it different from all that are used."""
    name, number = wish, 1
    while name in used:
        number += 1
        name = f"{wish}_{number}"
    return name


def _plain(name: str) -> str:
    """An identifier with the letters and digits of a name."""
    word = _OTHER.sub("_", name).strip("_") or "object"
    return f"_{word}" if word[0].isdigit() else word


# --------------------------------------------------------------------------------------------------------------------
# The file of a form: one rigid body at the origin, which scenes refer to, and which can be used by itself.


CONTACT = "contact"  # the name of the material for contacts


def part(root: str, number: int) -> tuple[str, str]:
    """The path of a mesh that is drawn, and the name of its material."""
    return f"{root}/visuals/part_{number}", f"part_{number}"


def picture(form: BodyForm, number: int) -> str:
    """The name of the file with the texture of a part, beside that of the form."""
    return f"{form.name}_{number}.png"


def body_file(body: Body) -> bytes:
    """The form of a body with its mass, friction and colours."""
    root = f"/{body.form.name}"
    stage = UsdStage(root, "component")
    moments, axes = principal(body.moments)
    stage.rigid(root, body.mass, body.form.inertia.center.tolist(), moments, axes)
    place = materials(stage, root)
    contact = f"{place}/{CONTACT}"
    stage.contact(contact, body.friction)
    stage.xform(f"{root}/visuals")
    for number, (mesh, color) in enumerate(zip(body.form.parts, body.colors, strict=True), start=1):
        path, name = part(root, number)
        stage.mesh(path, mesh, shaded(mesh)[1])
        material(stage, root, name, UsdMaterial(color))
        cover(stage, root, path, name, color)
        paint = body.form.paints.get(number)
        if paint is not None:
            stage.places(path, paint.places[mesh.faces.ravel()])
            stage.image(f"{place}/{name}", SHADER, f"./{picture(body.form, number)}", color)
    stage.guide(f"{root}/collisions")
    for number, piece in enumerate(body.form.pieces, start=1):
        path = f"{root}/collisions/piece_{number}"
        if piece.box is None:
            stage.mesh(path, piece.mesh)
        else:
            stage.box(path, *piece.box)
        stage.collider(path, contact, hull=piece.box is None)
    return stage.finished().text()


# --------------------------------------------------------------------------------------------------------------------
# The file of a scene, or of several: table, objects and environment.


ROOT, AROUND = "/Scene", "/Environment"
GRAVITY = 9.81  # m/s^2
STONE: RGB = (0.66, 0.67, 0.69)
WIDE, DEEP = 20.0, 0.1  # metres: the floor
ABOVE = 0.0001  # metres: a textured sheet, which collides with nothing, above what it covers
# On the table the object's coefficient counts: PhysX takes the larger one where a material says so, MuJoCo always.
SLIPPERY, LARGER = 0.01, "max"


class UsdScenes:
    """The scenes of a world, or those of one look. `folder` is the path of the meshes from their files, `ending` that
    of the meshes."""

    def __init__(self, world: World, folder: str, ending: str, dressed: SceneLook | None = None) -> None:
        self.world = world
        names = [body.name for body in world.bodies] if world.record is None else world.record.everything
        self.names = identifiers(names)  # the same in every scene of a file
        stage = UsdStage(ROOT, "assembly", world.title)
        self._table(stage, f"{ROOT}/{free('table', self.names.values())}", dressed)
        for body in world.colored(dressed):
            self._body(stage, body, f"./{folder}/{body.form.name}{ending}")
        _environment(stage, world, dressed)
        self.layer = stage.finished()

    def one(self, index: int) -> bytes:
        """The file of one scene."""
        for name, (at, turn) in self._places(index).items():
            self.layer.place(f"{ROOT}/{name}", at, turn)
        self.layer.say(ROOT, {**self._facts(), **self._facts_of(index)})
        return self.layer.text()

    def all_in_one(self, among: str) -> bytes:
        """One file, with the scenes as variants `scene_0001`, ... of the set `among`."""
        self.layer.say(ROOT, self._facts())
        self.layer.variants(ROOT, among)
        for index, scene in enumerate(self.world.scenes):
            self.layer.variant(ROOT, among, f"scene_{scene:04d}", self._facts_of(index), self._places(index))
        return self.layer.text()

    def _places(self, index: int) -> dict[str, tuple[tuple[float, float, float], Quaternion]]:
        return {
            self.names[body.name]: ((x, y, z), (qw, qx, qy, qz))
            for body, (x, y, z, qw, qx, qy, qz) in zip(self.world.bodies, self.world.places(index), strict=True)
        }

    def _facts(self) -> dict[str, Any]:
        """What all scenes share."""
        record = self.world.record
        if record is None:
            return {}
        varying = {"counts": record.counts, "assets": record.assets}
        return {"spec": record.spec} | {key: value for key, value in varying.items() if value}

    def _facts_of(self, index: int) -> dict[str, Any]:
        record = self.world.record
        phi = {} if record is None else {label: float(values[index]) for label, values in record.phi.items()}
        return {"scene": self.world.scenes[index], "phi": phi}

    def _body(self, stage: UsdStage, body: Body, file: str) -> None:
        path = f"{ROOT}/{self.names[body.name]}"
        stage.refer(path, file)
        stage.known_as(path, body.name)
        if body.fixed:
            stage.held(path)
        for number, color in enumerate(body.colors, start=1):
            recolor(stage, path, *part(path, number), color)

    def _table(self, stage: UsdStage, path: str, dressed: SceneLook | None) -> None:
        """The table, the regions on it, which are only drawn, and those at heights, which carry."""
        stage.xform(path, "component")
        contact = f"{materials(stage, path)}/{CONTACT}"
        stage.contact(contact, SLIPPERY, LARGER)
        color = WOODEN if dressed is None else dressed.table.mean
        material(stage, path, "wood", UsdMaterial(color))
        for number, (center, sizes) in enumerate(self.world.slabs()):
            slab = f"{path}/leg_{number}" if number else f"{path}/top"
            stage.box(slab, center, sizes)
            stage.collider(slab, contact, hull=False)
            cover(stage, path, slab, "wood", color)
        if dressed is not None and dressed.table.file:
            x0, y0, x1, y1 = self.world.table
            top = Wall(((x0 + x1) / 2.0, (y0 + y1) / 2.0, ABOVE), (1.0, 0.0, 0.0), x1 - x0, y1 - y0, (0.0, 1.0, 0.0))
            covering(stage, path, "cover", dressed.table)
            cover_rectangle(stage, path, f"{path}/cover", "cover", top, dressed.table)
        for number, patch in enumerate(self.world.patches, start=1):
            name, mesh = f"region_{number}", patch.mesh()
            region = f"{path}/{name}"
            stage.mesh(region, mesh, shaded(mesh)[1])
            material(stage, path, name, UsdMaterial(patch.color))
            cover(stage, path, region, name, patch.color)
            if patch.solid:
                stage.collider(region, contact, hull=True)


def _environment(stage: UsdStage, world: World, dressed: SceneLook | None) -> None:
    """Outside of the default prim: what a stage has once, however many scenes it refers to."""
    stage.xform(AROUND)
    stage.gravity(f"{AROUND}/physics", GRAVITY)
    lights(stage, AROUND, dressed)
    cameras(stage, AROUND, world.table)
    floor = f"{AROUND}/floor"
    x0, y0, x1, y1 = world.table
    x, y = (x0 + x1) / 2.0, (y0 + y1) / 2.0
    stage.box(floor, (x, y, -TALL - DEEP / 2.0), (WIDE, WIDE, DEEP))
    contact = f"{materials(stage, AROUND)}/{CONTACT}"
    stage.contact(contact, SLIPPERY, LARGER)
    stage.collider(floor, contact, hull=False)
    stone = STONE if dressed is None else dressed.ground.mean
    material(stage, AROUND, "stone", UsdMaterial(stone))
    cover(stage, AROUND, floor, "stone", stone)
    if dressed is None:
        return
    camera_of(stage, f"{AROUND}/look", dressed)
    if dressed.ground.file:
        ground = Wall((x, y, ABOVE - TALL), (1.0, 0.0, 0.0), WIDE, WIDE, (0.0, 1.0, 0.0))
        covering(stage, AROUND, "ground", dressed.ground)
        cover_rectangle(stage, AROUND, f"{AROUND}/ground", "ground", ground, dressed.ground)
    for number, wall in enumerate(dressed.each_wall(-TALL, world.table), start=1):
        if number == 1:
            covering(stage, AROUND, "wall", dressed.walls)
        cover_rectangle(stage, AROUND, f"{AROUND}/wall_{number}", "wall", wall, dressed.walls)


ENDING = ".usda"
KEY, KEY_EACH = 3_000, 1_500  # bytes of memory for a variant, and for each object in it
SET = "scene"


def meshes(world: World) -> Iterator[tuple[str, bytes]]:
    """Additional files of this world's scenes: name, bytes."""
    named = set[str]()
    for body in world.bodies:
        if body.form.name not in named:
            named.add(body.form.name)
            yield f"{body.form.name}{ENDING}", body_file(body)
            for number, paint in body.form.paints.items():
                yield picture(body.form, number), paint.png


def files(world: World, folder: str, *, together: bool) -> Iterator[bytes]:
    """The scenes as one file with a variant for each, or as a file each. `folder` is the path of the meshes from
    there. Raises RequestError for too many scenes in one file."""
    if together:
        check_room(len(world.poses), KEY + KEY_EACH * len(world.bodies))
    if world.dressing is not None:
        for index, number in enumerate(world.scenes):
            yield UsdScenes(world, folder, ENDING, world.dressing.of(number, world.table)).one(index)
        return
    scene = UsdScenes(world, folder, ENDING)
    if together:
        yield scene.all_in_one(SET)
        return
    for index in range(len(world.poses)):
        yield scene.one(index)
