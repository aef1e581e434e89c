"""Scenes as MJCF, the XML of MuJoCo (https://mujoco.readthedocs.io/en/stable/XMLreference.html).

Every object is a body of its name with a free joint; its frame is in the middle of its footprint at its lowest point.
Fixed objects have no joint. Visual meshes are OBJ files, in group 2; collision shapes are boxes and convex hulls in the
file itself, in group 3. A file has any number of scenes of the same objects, each as a keyframe.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree import ElementTree

from scenegen.assets.mesh import Mesh
from scenegen.assets.palette import RGB
from scenegen.export import obj
from scenegen.export.world import TALL, WOOD, Body, Form, Patch, World, piece_of
from scenegen.export.xml import Element, check_room, document, node, numbers, short

ENDING = ".xml"
KEY, KEY_EACH = 600, 600  # bytes of memory for a keyframe, and for each object in it
SPECK = 1e-12  # cubic metres
SLIPPERY = 0.01  # MuJoCo uses the larger friction of two: on the table, the object's

# MuJoCo's contacts give way: with its defaults (20 ms to recover) a tower of five blocks sinks and leans by a mm
# or two. These recover five times as fast. Damped critically, what overhangs an edge would rattle, and wander by a
# millimetre a second; so damping is twice that. Friction is ten times as stiff, in an elliptic cone.
STIFF = {"solref": "0.004 2", "solimp": "0.95 0.99 0.001"}
OPTIONS = {"timestep": "0.002", "cone": "elliptic", "impratio": "10"}


def meshes(world: World) -> Iterator[tuple[str, bytes]]:
    """Additional files of this world's scenes: name, bytes."""
    for form in world.forms:
        for number, part in enumerate(form.parts, start=1):
            yield f"{_part(form, number)}.obj", obj.smooth(part)


def files(world: World, folder: str, *, together: bool) -> Iterator[bytes]:
    """The scenes as one file with a keyframe for each, or as a file each. `folder` is the path of the meshes from
    there."""
    if together:
        check_room(len(world.poses), KEY + KEY_EACH * len(world.bodies))
    root = ElementTree.Element("mujoco", model=world.title or "scenegen")
    node(root, "compiler", angle="radian", meshdir=folder)
    node(node(root, "option", **OPTIONS), "flag", multiccd="enable")
    _looks(root, world)
    _defaults(root)
    _assets(root, world)
    table = node(root, "worldbody")
    _table(table, world)
    bodies = [_body(table, body) for body in world.bodies]
    keys = node(root, "keyframe")
    for scene, poses in zip(world.scenes, world.poses.tolist(), strict=True):
        qpos = [_qpos(pose) for pose in poses]
        if not together:
            keys.clear()
        if scene == world.scenes[0] or not together:
            for element, place in zip(bodies, qpos, strict=True):
                element.set("pos", numbers(*place[:3]))
                element.set("quat", numbers(*place[3:]))
        free = [value for body, place in zip(world.bodies, qpos, strict=True) if not body.fixed for value in place]
        node(keys, "key", name=f"scene_{scene:04d}", qpos=numbers(*free))
        if not together:
            yield document(root)
    if together:
        yield document(root)


def bench(world: World) -> bytes:
    """What collides and nothing else, in one model without files: the bodies at the origin, on an infinite table with
    the spec's boards. The contacts are those of the other files; a state that diverges is left as it is."""
    root = ElementTree.Element("mujoco", model="scenegen")
    node(root, "compiler", angle="radian")
    node(node(root, "option", **OPTIONS), "flag", multiccd="enable", autoreset="disable")
    _defaults(root)
    assets = node(root, "asset")
    _hulls(assets, world)
    for number, patch in enumerate(world.patches, start=1):
        if patch.solid:
            _sheet(assets, number, patch)
    parent = node(root, "worldbody")
    node(parent, "geom", name=world.free_name("table"), type="plane", size="0 0 1", friction=f"{SLIPPERY}")
    for number, patch in enumerate(world.patches, start=1):
        if patch.solid:
            _board(parent, number, patch)
    for body in world.bodies:
        _pieces(_solid(parent, body), body)
    return document(root)


def _looks(root: Element, world: World) -> None:
    """Light and picture size."""
    visual = node(root, "visual")
    node(visual, "headlight", ambient="0.35 0.35 0.35", diffuse="0.25 0.25 0.25", specular="0 0 0")
    node(visual, "quality", shadowsize="4096")
    node(visual, "map", shadowclip="2", shadowscale="1")
    node(visual, "global", offwidth="1920", offheight="1080")
    x0, y0, x1, y1 = world.table
    node(root, "statistic", center=short([(x0 + x1) / 2, (y0 + y1) / 2, 0.0]), extent=short([max(x1 - x0, y1 - y0)]))


def _defaults(root: Element) -> None:
    """What all geoms share, and those of a group."""
    defaults = node(root, "default")
    node(defaults, "geom", **STIFF)
    seen = node(defaults, "default", class_="seen")
    node(seen, "geom", type="mesh", contype="0", conaffinity="0", group="2", mass="0")
    solid = node(defaults, "default", class_="solid")
    node(solid, "geom", type="mesh", group="3", rgba="0.9 0.4 0.2 0.5")


def _assets(root: Element, world: World) -> None:
    assets = node(root, "asset")
    sky = {"rgb1": "0.86 0.89 0.93", "rgb2": "0.97 0.97 0.97", "width": "256", "height": "256"}
    node(assets, "texture", type="skybox", builtin="gradient", **sky)
    for form in world.forms:
        for number, part in enumerate(form.parts, start=1):
            node(assets, "mesh", name=_part(form, number), file=f"{_part(form, number)}.obj", **_shell(part))
    _hulls(assets, world)
    for number, patch in enumerate(world.patches, start=1):
        _sheet(assets, number, patch)


def _sheet(assets: Element, number: int, patch: Patch) -> None:
    mesh = patch.mesh()
    faces = " ".join(str(corner) for corner in mesh.faces.ravel().tolist())
    node(assets, "mesh", name=f"region_{number}", vertex=_vertices(mesh), face=faces, **_shell(mesh))


def _hulls(assets: Element, world: World) -> None:
    for form in world.forms:
        for number, piece in enumerate(form.pieces, start=1):
            if piece.box is None:
                mesh = piece.mesh
                node(assets, "mesh", name=_piece(form, number), vertex=_vertices(mesh), **_shell(mesh))


def _shell(mesh: Mesh) -> dict[str, str]:
    """MuJoCo computes an inertia for every mesh, used or not, and refuses meshes of nearly no volume. It never refuses
    a shell's inertia, but supports this only from version 3.3 on."""
    return {"inertia": "shell"} if mesh.volume < SPECK else {}


def _table(parent: Element, world: World) -> None:
    """Light, cameras, the floor, the table and its purely visual sheets."""
    x0, y0, x1, y1 = world.table
    x, y, side = (x0 + x1) / 2, (y0 + y1) / 2, max(x1 - x0, y1 - y0)
    sun = {"directional": "true", "diffuse": "0.45 0.45 0.45", "specular": "0.1 0.1 0.1", "dir": "0.3 0.3 -1"}
    node(parent, "light", pos=short([x - 0.6 * side, y - 0.6 * side, 2 * side]), **sun)
    node(parent, "camera", name=world.free_name("top"), pos=short([x, y, 1.6 * side]), fovy="45")
    turned = {"xyaxes": "1 0 0 0 0.7 0.714", "fovy": "45"}
    node(parent, "camera", name=world.free_name("front"), pos=short([x, y - 1.1 * side, 1.1 * side]), **turned)
    grey = {"rgba": "0.66 0.67 0.69 1", "friction": f"{SLIPPERY}"}
    node(
        parent, "geom", name=world.free_name("floor"), type="plane", size="3 3 1", pos=short([0.0, 0.0, -TALL]), **grey
    )
    table = node(parent, "body", name=world.free_name("table"))
    for center, sizes in world.slabs():
        half = short(size / 2 for size in sizes)
        node(table, "geom", type="box", size=half, pos=short(center), rgba=_rgba(WOOD), friction=f"{SLIPPERY}")
    for number, patch in enumerate(world.patches, start=1):
        node(table, "geom", class_="seen", mesh=f"region_{number}", rgba=_rgba(patch.color))
        if patch.solid:
            _board(table, number, patch)


def _board(table: Element, number: int, patch: Patch) -> None:
    """What bodies meet of a region at a height."""
    slippery = {"friction": f"{SLIPPERY}"}
    whole = piece_of(patch.mesh())
    if whole.box is None:
        node(table, "geom", class_="solid", mesh=f"region_{number}", **slippery)
    else:
        center, half = short(whole.box[0]), short(size / 2 for size in whole.box[1])
        node(table, "geom", class_="solid", type="box", pos=center, size=half, **slippery)


def _body(parent: Element, body: Body) -> Element:
    """An object without its place."""
    element = _solid(parent, body)
    for number, color in enumerate(body.colors, start=1):
        node(element, "geom", class_="seen", mesh=_part(body.form, number), rgba=_rgba(color))
    _pieces(element, body)
    return element


def _solid(parent: Element, body: Body) -> Element:
    """A body with its joint and its inertia, but without geoms."""
    element = node(parent, "body", name=body.name)
    if not body.fixed:
        node(element, "freejoint", name=body.name)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.moments.tolist()
    center = short(body.form.inertia.center.tolist())
    node(element, "inertial", pos=center, mass=short([body.mass]), fullinertia=short([xx, yy, zz, xy, xz, yz]))
    return element


def _pieces(element: Element, body: Body) -> None:
    """What a body collides with."""
    for number, piece in enumerate(body.form.pieces, start=1):
        friction = short([body.friction, 0.005, 0.0001])
        if piece.box is None:
            node(element, "geom", class_="solid", mesh=_piece(body.form, number), friction=friction)
        else:
            center, half = short(piece.box[0]), short(size / 2 for size in piece.box[1])
            node(element, "geom", class_="solid", type="box", pos=center, size=half, friction=friction)


def _qpos(pose: list[float]) -> tuple[float, ...]:
    """Place and quaternion (w first) of a pose x, y, z, theta."""
    x, y, z, theta = pose
    return x, y, z, math.cos(theta / 2), 0.0, 0.0, math.sin(theta / 2)


def _part(form: Form, number: int) -> str:
    return f"{form.name}_{number}"


def _piece(form: Form, number: int) -> str:
    return f"{form.name}_hull_{number}"


def _vertices(mesh: Mesh) -> str:
    return short(mesh.vertices.ravel().tolist())


def _rgba(color: RGB) -> str:
    return f"{short(color)} 1"
