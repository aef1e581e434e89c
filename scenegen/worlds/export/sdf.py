"""Scenes as SDF worlds, for Gazebo, Ignition and PyBullet (http://sdformat.org/spec, version 1.7).

Every object is a model of its name with one link; its frame is in the middle of its footprint at its lowest point.
Fixed objects are static. Visual meshes are OBJ files; collision shapes are boxes and convex OBJ files (Drake does not
read STL). A file has any number of scenes of the same objects, each as a world. Gazebo runs, and PyBullet loads, the
first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Literal
from xml.etree import ElementTree

import numpy as np

from scenegen.things.library import RGB
from scenegen.things.outline import Floats
from scenegen.worlds.export.meshes import drawn_obj, plain_obj, stl
from scenegen.worlds.export.world import TALL, WOODEN, Body, BodyForm, ConvexPiece, World, piece_of
from scenegen.worlds.export.xml import Element, document, join_documents, node, numbers, short

Hulls = Literal["obj", "stl"]

ENDING = ".sdf"
SDF_VERSION = "1.7"
TABLE_FRICTION = 1.0  # Gazebo uses the smaller friction of two, Bullet the product: both give the object's
HEAVY = 25.0  # kg, of floor and table: they are static, but PyBullet warns about bodies without mass
FLOOR_STONE: RGB = (0.75, 0.76, 0.78)


def meshes(world: World, *, hulls: Hulls = "obj") -> Iterator[tuple[str, bytes]]:
    """Additional files of this world's scenes: name, bytes."""
    for form in world.forms:
        for number, part in enumerate(form.parts, start=1):
            yield _part(form, number), drawn_obj(part)
        for number, piece in enumerate(form.pieces, start=1):
            if piece.box is None:
                yield _hull(form, number, hulls), plain_obj(piece.mesh) if hulls == "obj" else stl(piece.mesh)
    for number, patch in enumerate(world.patches, start=1):
        yield f"region_{number}.obj", drawn_obj(patch.mesh())


def files(world: World, folder: str, *, together: bool) -> Iterator[bytes]:
    """The scenes as one file with a world for each, or as a file each. `folder` is the path of the meshes from
    there."""
    root = ElementTree.Element("sdf", version=SDF_VERSION)
    if together:
        yield join_documents(root, _worlds(world, folder))
        return
    for element in _worlds(world, folder):
        root[:] = [element]
        yield document(root)


def _worlds(world: World, folder: str) -> Iterator[Element]:
    """The world of each scene: the same element, changed for each."""
    element, places = _world(world, folder)
    for index, scene in enumerate(world.scenes):
        element.set("name", f"scene_{scene:04d}")
        _place(places, world, index)
        yield element


def bare(world: World, folder: str, *, table: bool, hulls: Hulls = "obj") -> bytes:
    """The first scene as a file without floor, light and sky, to be added to another world."""
    root = ElementTree.Element("sdf", version=SDF_VERSION)
    element = node(root, "world", name="scene")
    if table:
        _table(element, world, folder)
    _place([_body(element, body, folder, hulls) for body in world.bodies], world, 0)
    return document(root)


def _place(places: Sequence[Element], world: World, index: int) -> None:
    for place, (x, y, z, theta) in zip(places, world.poses[index].tolist(), strict=True):
        place.text = numbers(x, y, z, 0, 0, theta)
    if world.rest is not None:
        for place, (x, y, z, *turn) in zip(places, world.rest[index].tolist(), strict=True):
            place.text = numbers(x, y, z, *_angles(*turn))


def _angles(w: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a quaternion: turns about the world's x, then y, then z."""
    roll = math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y))
    pitch = math.asin(max(-1.0, min(1.0, 2.0 * (w * y - z * x))))
    return roll, pitch, math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))


def _world(world: World, folder: str) -> tuple[Element, list[Element]]:
    """Everything except the objects' places, and the elements that take these."""
    element = ElementTree.Element("world")
    # Gazebo fills in what is left out; the specification calls these required.
    node(element, "gravity", "0 0 -9.81")
    node(element, "magnetic_field", "5.5645e-06 2.28758e-05 -4.23884e-05")
    node(element, "atmosphere", type="adiabatic")
    physics = node(element, "physics", type="ode")
    for tag, text in (("max_step_size", "0.001"), ("real_time_factor", "1"), ("real_time_update_rate", "1000")):
        node(physics, tag, text)
    look = node(element, "scene")
    for tag, text in (("ambient", "0.5 0.5 0.5 1"), ("background", "0.86 0.89 0.93 1"), ("shadows", "true")):
        node(look, tag, text)
    _sun(element, world)
    floor = node(element, "model", name=world.free_name("floor"))
    _pose(floor, static=True).text = short([0, 0, -TALL, 0, 0, 0])
    link = node(floor, "link", name="link")
    _inertial(link, np.zeros(3), HEAVY * np.eye(3), HEAVY)
    _slab(link, 1, (0.0, 0.0, -0.05), (20.0, 20.0, 0.1), FLOOR_STONE)
    _table(element, world, folder)
    return element, [_body(element, body, folder, "obj") for body in world.bodies]


def _sun(parent: Element, world: World) -> None:
    sun = node(parent, "light", name=world.free_name("sun"), type="directional")
    for tag, text in (("cast_shadows", "true"), ("pose", "0 0 10 0 0 0"), ("diffuse", "0.7 0.7 0.7 1")):
        node(sun, tag, text)
    node(sun, "specular", "0.1 0.1 0.1 1")
    node(sun, "direction", "0.3 0.3 -0.9")


def _table(parent: Element, world: World, folder: str) -> None:
    """The table, and its purely visual sheets."""
    model = node(parent, "model", name=world.free_name("table"))
    _pose(model, static=True).text = "0 0 0 0 0 0"
    link = node(model, "link", name="link")
    _inertial(link, np.zeros(3), HEAVY * np.eye(3), HEAVY)
    for number, (center, sizes) in enumerate(world.slabs(), start=1):
        _slab(link, number, center, sizes, WOODEN)
    for number, patch in enumerate(world.patches, start=1):
        element = node(link, "visual", name=f"region_{number}")
        _mesh(element, f"{folder}/region_{number}.obj")
        _color(element, patch.color)
        if patch.solid:
            whole = piece_of(patch.mesh())
            _collision(link, f"board_{number}", whole, f"{folder}/region_{number}.obj")


def _collision(link: Element, name: str, piece: ConvexPiece, path: str) -> Element:
    """A convex piece, a box or the mesh in a file."""
    element = node(link, "collision", name=name)
    if piece.box is None:
        _mesh(element, path)
    else:
        node(element, "pose", short([*piece.box[0], 0.0, 0.0, 0.0]))
        node(node(node(element, "geometry"), "box"), "size", short(piece.box[1]))
    return element


def _slab(link: Element, number: int, center: Sequence[float], sizes: Sequence[float], color: RGB) -> None:
    """A box that is visible and collides."""
    for tag in ("collision", "visual"):
        element = node(link, tag, name=f"{tag}_{number}")
        node(element, "pose", short([*center, 0.0, 0.0, 0.0]))
        node(node(node(element, "geometry"), "box"), "size", short(sizes))
        if tag == "collision":
            _friction(element, TABLE_FRICTION)
        else:
            _color(element, color)


def _body(parent: Element, body: Body, folder: str, hulls: Hulls) -> Element:
    """An object; returns the element that takes its place."""
    model = node(parent, "model", name=body.name)
    place = _pose(model, static=body.fixed)
    link = node(model, "link", name="link")
    _inertial(link, body.form.inertia.center, body.moments, body.mass)
    for number, piece in enumerate(body.form.pieces, start=1):
        path = f"{folder}/{_hull(body.form, number, hulls)}"
        _friction(_collision(link, f"collision_{number}", piece, path), body.friction)
    for number, color in enumerate(body.colors, start=1):
        element = node(link, "visual", name=f"visual_{number}")
        _mesh(element, f"{folder}/{_part(body.form, number)}")
        _color(element, color)
    return place


def _pose(model: Element, *, static: bool) -> Element:
    node(model, "static", "1" if static else "0")  # PyBullet does not understand `true`
    return node(model, "pose")


def _inertial(link: Element, center: Floats, moments: Floats, mass: float) -> None:
    inertial = node(link, "inertial")
    node(inertial, "mass", short([mass]))
    node(inertial, "pose", short([*center.tolist(), 0.0, 0.0, 0.0]))
    inertia = node(inertial, "inertia")
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = moments.tolist()
    for tag, value in (("ixx", xx), ("ixy", xy), ("ixz", xz), ("iyy", yy), ("iyz", yz), ("izz", zz)):
        node(inertia, tag, short([value]))


def _mesh(element: Element, path: str) -> None:
    node(node(node(element, "geometry"), "mesh"), "uri", path)


def _friction(element: Element, value: float) -> None:
    friction = node(node(element, "surface"), "friction")
    ode, bullet = node(friction, "ode"), node(friction, "bullet")
    for parent, tags in ((ode, ("mu", "mu2")), (bullet, ("friction", "friction2"))):
        for tag in tags:
            node(parent, tag, short([value]))


def _color(element: Element, color: RGB) -> None:
    material = node(element, "material")
    for tag in ("ambient", "diffuse"):
        node(material, tag, f"{short(color)} 1")


def _part(form: BodyForm, number: int) -> str:
    return f"{form.name}_{number}.obj"


def _hull(form: BodyForm, number: int, ending: str) -> str:
    return f"{form.name}_hull_{number}.{ending}"
