"""Scenes as MJCF, the XML of MuJoCo (https://mujoco.readthedocs.io/en/stable/XMLreference.html).

Every object is a body of its name with a free joint; its frame is in the middle of its footprint at its lowest point.
Fixed objects have no joint. Visual meshes are OBJ files, in group 2; collision shapes are boxes and convex hulls in the
file itself, in group 3. A file has one scene, or any number of scenes of the same objects, each as a keyframe.

A robot's file may include a scene, and is one model with it: so there is no <compiler>, defaults are those of classes,
and one scene has no keyframe, whose numbers would be those of the robot's joints.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from xml.etree import ElementTree

import numpy as np

from scenegen.things.mesh import Mesh
from scenegen.worlds.export.looks import SceneLook, TexturedColor
from scenegen.worlds.export.meshes import drawn_obj
from scenegen.worlds.export.world import TALL, TEXTURES, WOODEN, Body, BodyForm, ConvexPiece, Patch, World, piece_of
from scenegen.worlds.export.xml import Element, check_room, document, node, numbers, short

GREY = "0.66 0.67 0.69 1"
COLLIDER = "scenegen"  # the class of what collides, and of all that is of it
SLIPPERY = 0.01  # MuJoCo uses the larger friction of two: on the table, the object's
HALF_FLOOR = 3.0  # metres: half the floor
SEEN_ONLY = {"contype": "0", "conaffinity": "0", "group": "2", "mass": "0"}


def visual(root: Element, world: World, dressed: SceneLook | None) -> None:
    """Ambient light and the size of pictures."""
    place = node(root, "visual")
    if dressed is None:
        node(place, "headlight", ambient="0.35 0.35 0.35", diffuse="0.25 0.25 0.25", specular="0 0 0")
    else:
        ambient = _light(dressed, dressed.look.light_ambient)
        node(place, "headlight", ambient=ambient, diffuse="0 0 0", specular="0 0 0")
    node(place, "quality", shadowsize="4096")
    node(place, "map", shadowclip="2", shadowscale="1")
    node(place, "global", offwidth="1920", offheight="1080")
    x0, y0, x1, y1 = world.table
    node(root, "statistic", center=short([(x0 + x1) / 2, (y0 + y1) / 2, 0.0]), extent=short([max(x1 - x0, y1 - y0)]))


def materials(parent: Element, world: World, dressed: SceneLook | None) -> None:
    """The sky, and the materials of a look."""
    sky = {"rgb1": "0.86 0.89 0.93", "rgb2": "0.97 0.97 0.97", "width": "256", "height": "256"}
    node(parent, "texture", type="skybox", builtin="gradient", **sky)
    if dressed is None:
        return
    x0, y0, x1, y1 = world.table
    _texture(parent, "table", dressed.table)
    _material(parent, "table", dressed.table, "table", x1 - x0, y1 - y0)
    _texture(parent, "floor", dressed.ground)
    _material(parent, "floor", dressed.ground, "floor", 2.0 * HALF_FLOOR, 2.0 * HALF_FLOOR)
    for number, wall in enumerate(dressed.each_wall(-TALL, world.table), start=1):
        if number == 1:
            _texture(parent, "wall", dressed.walls)
        _material(parent, f"wall_{number}", dressed.walls, "wall", wall.width, wall.height)


def table_cover(dressed: SceneLook | None) -> dict[str, str]:
    """The attributes of the table's top."""
    return {"rgba": rgba(WOODEN)} if dressed is None else {"material": "table"}


def leg_color(dressed: SceneLook | None) -> str:
    return rgba(WOODEN if dressed is None else dressed.table.mean)


def surroundings(parent: Element, world: World, dressed: SceneLook | None) -> None:
    """Light, cameras, the floor and walls."""
    x0, y0, x1, y1 = world.table
    x, y, side = (x0 + x1) / 2, (y0 + y1) / 2, max(x1 - x0, y1 - y0)
    above = {"pos": short([x - 0.6 * side, y - 0.6 * side, 2 * side]), "directional": "true"}
    if dressed is None:
        node(parent, "light", **above, diffuse="0.45 0.45 0.45", specular="0.1 0.1 0.1", dir="0.3 0.3 -1")
    else:
        towards = np.array(dressed.look.towards)
        above["pos"] = short(np.array([x, y, 0.0]) + 2.0 * side * towards / np.linalg.norm(towards))
        sun = _light(dressed, dressed.look.light_intensity)
        node(parent, "light", **above, diffuse=sun, specular="0.1 0.1 0.1", dir=short(-towards))
    node(parent, "camera", name=world.free_name("top"), pos=short([x, y, 1.6 * side]), fovy="45")
    turned = {"xyaxes": "1 0 0 0 0.7 0.714", "fovy": "45"}
    node(parent, "camera", name=world.free_name("front"), pos=short([x, y - 1.1 * side, 1.1 * side]), **turned)
    floor = {"type": "plane", "size": short([HALF_FLOOR, HALF_FLOOR, 1.0]), "pos": short([0.0, 0.0, -TALL])}
    cover = {"rgba": GREY} if dressed is None else {"material": "floor"}
    node(parent, "geom", class_=COLLIDER, name=world.free_name("floor"), **floor, **cover, friction=f"{SLIPPERY}")
    if dressed is None:
        return
    right, up, _ = dressed.camera.view[:3, :3]
    place = {"pos": short(dressed.camera.eye), "xyaxes": short([*right, *up])}
    node(parent, "camera", name=world.free_name("look"), **place, fovy=short([dressed.look.camera_fov]))
    for number, wall in enumerate(dressed.each_wall(-TALL, world.table), start=1):
        shape = {"type": "plane", "size": short([wall.width / 2.0, wall.height / 2.0, 1.0])}
        place = {"pos": short(wall.middle), "xyaxes": short([*wall.across, *wall.up])}
        node(parent, "geom", **shape, **place, material=f"wall_{number}", **SEEN_ONLY)


def _texture(parent: Element, name: str, covering: TexturedColor) -> None:
    if covering.file:
        node(parent, "texture", name=name, type="2d", file=f"{TEXTURES}/{covering.file}")


def _material(parent: Element, name: str, what: TexturedColor, texture: str, width: float, height: float) -> None:
    """For one geom of this size: MuJoCo's repeats per metre (`texuniform`) are of half a metre."""
    given = {"texture": texture, "texrepeat": short(what.repeats(width, height))} if what.file else {}
    node(parent, "material", name=name, **given, rgba=rgba(what.color), specular="0.1", shininess="0.1")


def rgba(color: Iterable[float]) -> str:
    """An opaque colour."""
    return f"{short(color)} 1"


def _light(dressed: SceneLook, strength: float) -> str:
    return short(min(strength * channel, 1.0) for channel in dressed.look.light_color)


ENDING = ".xml"
KEY, KEY_EACH = 600, 600  # bytes of memory for a keyframe, and for each object in it
SPECK = 1e-12  # cubic metres

# MuJoCo's contacts give way: with its defaults (20 ms to recover) a tower of five blocks sinks and leans by a mm
# or two. These recover five times as fast. Damped critically, what overhangs an edge would rattle, and wander by a
# millimetre a second; so damping is twice that. Friction is ten times as stiff, in an elliptic cone.
STIFF = {"solref": "0.004 2", "solimp": "0.95 0.99 0.001"}
CONTACT_OPTIONS = {"cone": "elliptic", "impratio": "10"}


def meshes(world: World) -> Iterator[tuple[str, bytes]]:
    """Additional files of this world's scenes: name, bytes."""
    for form in world.forms:
        for number, part in enumerate(form.parts, start=1):
            paint = form.paints.get(number)
            if paint is None:
                yield f"{_part(form, number)}.obj", drawn_obj(part)
            else:
                yield f"{_part(form, number)}.obj", drawn_obj(part, paint.places)
                yield f"{_part(form, number)}.png", paint.png


def files(world: World, folder: str, *, together: bool) -> Iterator[bytes]:
    """The scenes as one file with a keyframe for each, or as a file each. `folder` is the path of the meshes from
    there."""
    if together:
        check_room(len(world.poses), KEY + KEY_EACH * len(world.bodies))
    root, bodies = _model(world, folder, None)
    keys = ElementTree.Element("keyframe")
    for index, scene in enumerate(world.scenes):
        if world.dressing is not None:
            root, bodies = _model(world, folder, world.dressing.scene_look(scene, world.table))
        qpos = world.places(index)
        if index == 0 or not together:
            for element, place in zip(bodies, qpos, strict=True):
                element.set("pos", numbers(*place[:3]))
                element.set("quat", numbers(*place[3:]))
        if together and len(world.poses) > 1:
            free = [value for body, place in zip(world.bodies, qpos, strict=True) if not body.fixed for value in place]
            node(keys, "key", name=f"scene_{scene:04d}", qpos=numbers(*free))
        elif not together:
            yield document(root)
    if together:
        if len(keys):
            root.append(keys)
        yield document(root)


def _model(world: World, folder: str, dressed: SceneLook | None) -> tuple[Element, list[Element]]:
    """A file without places: its root and the bodies."""
    root = ElementTree.Element("mujoco", model=world.title or "scenegen")
    node(node(root, "option", **CONTACT_OPTIONS), "flag", multiccd="enable")
    visual(root, world, dressed)
    _defaults(root)
    _assets(root, world, dressed, folder)
    place = node(root, "worldbody")
    _table(place, world, dressed)
    bodies = [_body(place, body) for body in world.tinted_bodies(dressed)]
    return root, bodies


def bench(world: World) -> bytes:
    """What collides and nothing else, in one model without files: the bodies at the origin, on an infinite table with
    the spec's boards. The contacts are those of the other files; a state that diverges is left as it is."""
    root = ElementTree.Element("mujoco", model="scenegen")
    node(node(root, "option", **CONTACT_OPTIONS), "flag", multiccd="enable", autoreset="disable")
    _defaults(root)
    assets = node(root, "asset")
    _hulls(assets, world)
    for number, patch in enumerate(world.patches, start=1):
        if patch.solid:
            _sheet(assets, number, patch)
    parent = node(root, "worldbody")
    table = {"class_": COLLIDER, "name": world.free_name("table")}
    node(parent, "geom", **table, type="plane", size="0 0 1", friction=f"{SLIPPERY}")
    for number, patch in enumerate(world.patches, start=1):
        if patch.solid:
            _board(parent, number, patch)
    for body in world.bodies:
        _pieces(_solid(parent, body), body)
    return document(root)


def _defaults(root: Element) -> None:
    """What all geoms share, and those of a group, as classes: what has none keeps its own."""
    defaults = node(node(root, "default"), "default", class_=COLLIDER)
    node(defaults, "geom", **STIFF)
    seen = node(defaults, "default", class_="seen")
    # said though they are MuJoCo's own: a robot's defaults reach what is included into its file
    node(seen, "geom", type="mesh", contype="0", conaffinity="0", group="2", mass="0", margin="0")
    solid = node(defaults, "default", class_="solid")
    node(solid, "geom", type="mesh", contype="1", conaffinity="1", group="3", margin="0", rgba="0.9 0.4 0.2 0.5")


def _assets(root: Element, world: World, dressed: SceneLook | None, folder: str) -> None:
    assets = node(root, "asset")
    materials(assets, world, dressed)
    for form in world.forms:
        for number, part in enumerate(form.parts, start=1):
            name = _part(form, number)
            shell = {"inertia": "shell"} if form.shells else _shell(part)
            node(assets, "mesh", name=name, file=f"{folder}/{name}.obj", scale="1 1 1", **shell)
            if number in form.paints:
                node(assets, "texture", name=name, type="2d", file=f"{folder}/{name}.png")
                node(assets, "material", name=name, texture=name)
    _hulls(assets, world)
    for number, patch in enumerate(world.patches, start=1):
        _sheet(assets, number, patch)


def _sheet(assets: Element, number: int, patch: Patch) -> None:
    mesh = patch.mesh()
    faces = " ".join(str(corner) for corner in mesh.faces.ravel().tolist())
    node(assets, "mesh", name=f"region_{number}", vertex=_vertices(mesh), face=faces, scale="1 1 1", **_shell(mesh))


def _hulls(assets: Element, world: World) -> None:
    for form in world.forms:
        for number, piece in enumerate(form.pieces, start=1):
            if piece.box is None:
                mesh = piece.mesh
                node(assets, "mesh", name=_piece(form, number), vertex=_vertices(mesh), scale="1 1 1", **_shell(mesh))


def _shell(mesh: Mesh) -> dict[str, str]:
    """MuJoCo computes an inertia for every mesh, used or not, and refuses meshes of nearly no volume. It never refuses
    a shell's inertia, but supports this only from version 3.3 on."""
    return {"inertia": "shell"} if mesh.volume < SPECK else {}


def _table(parent: Element, world: World, dressed: SceneLook | None) -> None:
    """What is around the table, the table and its purely visual sheets."""
    surroundings(parent, world, dressed)
    table = node(parent, "body", name=world.free_name("table"))
    for number, (center, sizes) in enumerate(world.slabs()):
        cover = {"rgba": leg_color(dressed)} if number else table_cover(dressed)
        half = short(size / 2 for size in sizes)
        node(table, "geom", class_=COLLIDER, type="box", size=half, pos=short(center), **cover, friction=f"{SLIPPERY}")
    for number, patch in enumerate(world.patches, start=1):
        node(table, "geom", class_="seen", mesh=f"region_{number}", rgba=rgba(patch.color))
        if patch.solid:
            _board(table, number, patch)


def _board(table: Element, number: int, patch: Patch) -> None:
    """What bodies meet of a region at a height."""
    _piece_geom(table, piece_of(patch.mesh()), f"region_{number}", f"{SLIPPERY}")


def _body(parent: Element, body: Body) -> Element:
    """An object without its place."""
    element = _solid(parent, body)
    for number, color in enumerate(body.colors, start=1):
        name = _part(body.form, number)
        paint = {"material": name} if number in body.form.paints else {}
        node(element, "geom", class_="seen", mesh=name, **paint, rgba=rgba(color))
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
        _piece_geom(element, piece, _piece(body.form, number), short([body.friction, 0.005, 0.0001]))


def _piece_geom(parent: Element, piece: ConvexPiece, mesh: str, friction: str) -> None:
    """A convex piece: a box, or a mesh by its name."""
    if piece.box is None:
        node(parent, "geom", class_="solid", mesh=mesh, friction=friction)
    else:
        center, half = short(piece.box[0]), short(size / 2 for size in piece.box[1])
        node(parent, "geom", class_="solid", type="box", pos=center, size=half, friction=friction)


def _part(form: BodyForm, number: int) -> str:
    return f"{form.name}_{number}"


def _piece(form: BodyForm, number: int) -> str:
    return f"{form.name}_hull_{number}"


def _vertices(mesh: Mesh) -> str:
    return short(mesh.vertices.ravel().tolist())
