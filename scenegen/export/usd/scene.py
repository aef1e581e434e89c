"""The file of a scene, or of several: table, objects and environment."""

from __future__ import annotations

from typing import Any

from scenegen.assets.mesh import shaded
from scenegen.assets.palette import RGB
from scenegen.export.dressing import Dressed, Wall
from scenegen.export.usd.axes import Quaternion
from scenegen.export.usd.form import CONTACT, part
from scenegen.export.usd.looks import (
    Look,
    camera_of,
    cameras,
    cover,
    cover_rectangle,
    covering,
    lights,
    material,
    materials,
    recolor,
)
from scenegen.export.usd.names import free, identifiers
from scenegen.export.usd.stage import Stage
from scenegen.export.world import TALL, WOOD, Body, World

ROOT, AROUND = "/Scene", "/Environment"
GRAVITY = 9.81  # m/s^2
STONE: RGB = (0.66, 0.67, 0.69)
WIDE, DEEP = 20.0, 0.1  # metres: the floor
ABOVE = 0.0001  # metres: a textured sheet, which collides with nothing, above what it covers
# On the table the object's coefficient counts: PhysX takes the larger one where a material says so, MuJoCo always.
SLIPPERY, LARGER = 0.01, "max"


class Scene:
    """The scenes of a world, or those of one look. `folder` is the path of the meshes from their files, `ending` that
    of the meshes."""

    def __init__(self, world: World, folder: str, ending: str, dressed: Dressed | None = None) -> None:
        self.world = world
        names = [body.name for body in world.bodies] if world.record is None else world.record.everything
        self.names = identifiers(names)  # the same in every scene of a file
        stage = Stage(ROOT, "assembly", world.title)
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

    def _body(self, stage: Stage, body: Body, file: str) -> None:
        path = f"{ROOT}/{self.names[body.name]}"
        stage.refer(path, file)
        stage.known_as(path, body.name)
        if body.fixed:
            stage.held(path)
        for number, color in enumerate(body.colors, start=1):
            recolor(stage, path, *part(path, number), color)

    def _table(self, stage: Stage, path: str, dressed: Dressed | None) -> None:
        """The table, the regions on it, which are only drawn, and those at heights, which carry."""
        stage.xform(path, "component")
        contact = f"{materials(stage, path)}/{CONTACT}"
        stage.contact(contact, SLIPPERY, LARGER)
        color = WOOD if dressed is None else dressed.table.mean
        material(stage, path, "wood", Look(color))
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
            material(stage, path, name, Look(patch.color))
            cover(stage, path, region, name, patch.color)
            if patch.solid:
                stage.collider(region, contact, hull=True)


def _environment(stage: Stage, world: World, dressed: Dressed | None) -> None:
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
    material(stage, AROUND, "stone", Look(stone))
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
