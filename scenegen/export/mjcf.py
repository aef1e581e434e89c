"""Scenes as MJCF, the XML of MuJoCo (https://mujoco.readthedocs.io/en/stable/XMLreference.html).

Every object is a body of its name with a free joint; its frame is in the middle of its footprint at its lowest point.
Fixed objects have no joint. Visual meshes are OBJ files, in group 2; collision shapes are boxes and convex hulls in the
file itself, in group 3. A file has one scene, or any number of scenes of the same objects, each as a keyframe.

A robot's file may include a scene, and is one model with it: so there is no <compiler>, defaults are those of classes,
and one scene has no keyframe, whose numbers would be those of the robot's joints.
"""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree

from scenegen.assets.mesh import Mesh
from scenegen.export import obj
from scenegen.export.dressing import Dressed
from scenegen.export.mjcf_looks import SLIPPERY, STIFFER, leg_color, rgba, surroundings, table_cover, visual
from scenegen.export.mjcf_looks import assets as materials
from scenegen.export.world import Body, Form, Patch, World, piece_of
from scenegen.export.xml import Element, check_room, document, node, numbers, short

ENDING = ".xml"
KEY, KEY_EACH = 600, 600  # bytes of memory for a keyframe, and for each object in it
SPECK = 1e-12  # cubic metres

# MuJoCo's contacts give way: with its defaults (20 ms to recover) a tower of five blocks sinks and leans by a mm
# or two. These recover five times as fast. Damped critically, what overhangs an edge would rattle, and wander by a
# millimetre a second; so damping is twice that. Friction is ten times as stiff, in an elliptic cone.
STIFF = {"solref": "0.004 2", "solimp": "0.95 0.99 0.001"}
OPTIONS = {"cone": "elliptic", "impratio": "10"}


def meshes(world: World) -> Iterator[tuple[str, bytes]]:
    """Additional files of this world's scenes: name, bytes."""
    for form in world.forms:
        for number, part in enumerate(form.parts, start=1):
            paint = form.paints.get(number)
            if paint is None:
                yield f"{_part(form, number)}.obj", obj.smooth(part)
            else:
                yield f"{_part(form, number)}.obj", obj.painted(part, paint.places)
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
            root, bodies = _model(world, folder, world.dressing.of(scene, world.table))
        qpos = world.places(index)
        if index == 0 or not together:
            for element, place in zip(bodies, qpos, strict=True):
                element.set("pos", numbers(*place[:3]))
                element.set("quat", numbers(*place[3:]))
        if together:
            free = [value for body, place in zip(world.bodies, qpos, strict=True) if not body.fixed for value in place]
            node(keys, "key", name=f"scene_{scene:04d}", qpos=numbers(*free))
        else:
            yield document(root)
    if together:
        root.append(keys)
        yield document(root)


def _model(world: World, folder: str, dressed: Dressed | None) -> tuple[Element, list[Element]]:
    """A file without places: its root and the bodies."""
    root = ElementTree.Element("mujoco", model=world.title or "scenegen")
    node(node(root, "option", **OPTIONS), "flag", multiccd="enable")
    visual(root, world, dressed)
    _defaults(root)
    _assets(root, world, dressed, folder)
    place = node(root, "worldbody")
    _table(place, world, dressed)
    bodies = [_body(place, body) for body in world.colored(dressed)]
    return root, bodies


def bench(world: World) -> bytes:
    """What collides and nothing else, in one model without files: the bodies at the origin, on an infinite table with
    the spec's boards. The contacts are those of the other files; a state that diverges is left as it is."""
    root = ElementTree.Element("mujoco", model="scenegen")
    node(node(root, "option", **OPTIONS), "flag", multiccd="enable", autoreset="disable")
    _defaults(root)
    assets = node(root, "asset")
    _hulls(assets, world)
    for number, patch in enumerate(world.patches, start=1):
        if patch.solid:
            _sheet(assets, number, patch)
    parent = node(root, "worldbody")
    table = {"class_": STIFFER, "name": world.free_name("table")}
    node(parent, "geom", **table, type="plane", size="0 0 1", friction=f"{SLIPPERY}")
    for number, patch in enumerate(world.patches, start=1):
        if patch.solid:
            _board(parent, number, patch)
    for body in world.bodies:
        _pieces(_solid(parent, body), body)
    return document(root)


def _defaults(root: Element) -> None:
    """What all geoms share, and those of a group, as classes: what has none keeps its own."""
    defaults = node(node(root, "default"), "default", class_=STIFFER)
    node(defaults, "geom", **STIFF)
    seen = node(defaults, "default", class_="seen")
    # said though they are MuJoCo's own: a robot's defaults reach what is included into its file
    node(seen, "geom", type="mesh", contype="0", conaffinity="0", group="2", mass="0", margin="0")
    solid = node(defaults, "default", class_="solid")
    node(solid, "geom", type="mesh", contype="1", conaffinity="1", group="3", margin="0", rgba="0.9 0.4 0.2 0.5")


def _assets(root: Element, world: World, dressed: Dressed | None, folder: str) -> None:
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


def _table(parent: Element, world: World, dressed: Dressed | None) -> None:
    """What is around the table, the table and its purely visual sheets."""
    surroundings(parent, world, dressed)
    table = node(parent, "body", name=world.free_name("table"))
    for number, (center, sizes) in enumerate(world.slabs()):
        cover = {"rgba": leg_color(dressed)} if number else table_cover(dressed)
        half = short(size / 2 for size in sizes)
        node(table, "geom", class_=STIFFER, type="box", size=half, pos=short(center), **cover, friction=f"{SLIPPERY}")
    for number, patch in enumerate(world.patches, start=1):
        node(table, "geom", class_="seen", mesh=f"region_{number}", rgba=rgba(patch.color))
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
        friction = short([body.friction, 0.005, 0.0001])
        if piece.box is None:
            node(element, "geom", class_="solid", mesh=_piece(body.form, number), friction=friction)
        else:
            center, half = short(piece.box[0]), short(size / 2 for size in piece.box[1])
            node(element, "geom", class_="solid", type="box", pos=center, size=half, friction=friction)


def _part(form: Form, number: int) -> str:
    return f"{form.name}_{number}"


def _piece(form: Form, number: int) -> str:
    return f"{form.name}_hull_{number}"


def _vertices(mesh: Mesh) -> str:
    return short(mesh.vertices.ravel().tolist())
