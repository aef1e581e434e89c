"""What a file of one's own shows, to be drawn as it is: glTF, .obj, .stl, and the visual shapes of a URDF file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from scenegen.things import gltf, wavefront
from scenegen.things.colored_mesh import WHITE, Budget, Surface, refuse_layers, tidy
from scenegen.things.mesh import Floats, Mesh, box, disc, revolve
from scenegen.things.meshfile import MeshError, beside, ending_of, vertices
from scenegen.things.palette import RGB
from scenegen.things.urdf import (
    GLTF,
    Element,
    ElementsError,
    Pose,
    UrdfError,
    elements,
    links_of,
    numbers_of,
    origin_of,
    sizes_of,
    solid_of,
)

RINGS = 16  # of a sphere, from pole to pole

Read = Callable[[str], bytes]


def mesh_surfaces(
    name: str, data: bytes, read: Read, budget: Budget | None = None, *, painted: bool = True
) -> tuple[Surface, ...]:
    """The surfaces of a .glb, .gltf, .obj or .stl file, in its own unit, z upwards (as `gltf.surfaces` turns them).

    `read` gives the bytes of a file that it names, relative to it; what that raises passes through. Not
    `painted`, the colours of .obj files are left out. Raises MeshError.
    """
    found = _surfaces(name, data, read, budget or Budget(), painted=painted)
    refuse_layers(found)
    return found


def _surfaces(name: str, data: bytes, read: Read, budget: Budget, *, painted: bool) -> tuple[Surface, ...]:
    ending = ending_of(name)
    if ending in GLTF:
        return gltf.surfaces(name, data, read)
    if ending == ".obj":
        return tuple(map(tidy, wavefront.surfaces(name, data, read, budget, painted=painted)))
    corners = vertices(name, data)
    if len(corners) % 3:
        raise MeshError("it is cut short: a triangle in it has fewer than three corners")
    budget.add_vertices(len(corners))
    budget.add_triangles(len(corners) // 3)
    return (tidy(Surface(corners, np.arange(len(corners)).reshape(-1, 3), None)),)


def robot_surfaces(data: bytes, read: Read) -> tuple[Surface, ...]:
    """The visual shapes of a URDF file in the frame of its root link, all joints at zero; the collision shapes of one
    that has no visual shape at all.

    A mesh's own colours and textures count; what has none gets those of the shape's <material>. `read` as in
    `mesh_surfaces`, by names as the file has them. Raises UrdfError, with line and element.
    """
    try:
        robot = elements(data)
        links = links_of(robot)
        shapes = [(one, pose) for link, pose in links for one in link.all("visual")]
        shapes = shapes or [(one, pose) for link, pose in links for one in link.all("collision")]
        if not shapes:
            raise UrdfError("no link of it has a shape")
        inside = [one for shape, _ in shapes for one in shape.all("material")]
        named: dict[str, Element] = {}
        for material in (*robot.all("material"), *inside):
            if material.children:
                named.setdefault(material.attributes.get("name", ""), material)
        reader = _Reader(read, named)
        found = tuple(made for shape, pose in shapes for made in reader.surfaces(shape, pose.then(origin_of(shape))))
        try:
            refuse_layers(found)
        except MeshError as error:
            raise UrdfError(str(error)) from None
        return found
    except ElementsError as error:
        raise UrdfError(str(error)) from None


@dataclass(slots=True)
class _Reader:
    read: Read
    named: dict[str, Element]
    budget: Budget = field(default_factory=Budget)
    meshes: dict[str, tuple[Surface, ...]] = field(default_factory=dict)
    textures: dict[str, bytes] = field(default_factory=dict)

    def surfaces(self, shape: Element, pose: Pose) -> list[Surface]:
        """Raises UrdfError, ElementsError."""
        solid = solid_of(shape)
        color, texture = self._material(shape)
        try:
            found = self._solid(solid)
        except MeshError as error:
            raise UrdfError(f"{solid.place}: {error}") from None
        made = []
        for one in found:
            if one.color is None:
                if texture and one.uv is None:
                    raise UrdfError(f"{solid.place}: it has a texture and no places in it: only .obj meshes have them")
                one = replace(one, color=color, texture=texture)
            made.append(replace(one, vertices=one.vertices @ pose.turn.T + pose.at))
        return made

    def _solid(self, solid: Element) -> tuple[Surface, ...]:
        """A shape in its own frame."""
        match solid.tag:
            case "box":
                x, y, z = sizes_of(solid, "size", 3)
                return self._counted(box(x, y, z).moved(z=-z / 2.0))
            case "cylinder":
                (radius,), (length,) = sizes_of(solid, "radius", 1), sizes_of(solid, "length", 1)
                return self._counted(disc(radius, -length / 2.0, length / 2.0))
            case "sphere":
                (radius,) = sizes_of(solid, "radius", 1)
                turns = np.linspace(-np.pi / 2.0, np.pi / 2.0, RINGS + 1)[1:-1]
                arc = [(radius * float(np.cos(turn)), radius * float(np.sin(turn))) for turn in turns]
                return self._counted(revolve([(0.0, -radius), *arc, (0.0, radius)], 2 * RINGS))
            case _:
                scale = np.array(numbers_of(solid, "scale", 3, "1 1 1"))
                return tuple(_scaled(one, scale) for one in self._mesh(solid.get("filename")))

    def _counted(self, mesh: Mesh) -> tuple[Surface, ...]:
        self.budget.add_vertices(len(mesh.vertices))
        self.budget.add_triangles(len(mesh.faces))
        return (Surface(mesh.vertices, mesh.faces, None),)

    def _mesh(self, name: str) -> tuple[Surface, ...]:
        """A mesh file in its own frame, read once and counted as often as it is placed."""
        if name in self.meshes:
            for one in self.meshes[name]:
                self.budget.add_vertices(len(one.vertices))
                self.budget.add_triangles(len(one.faces))
        else:
            if ending_of(name) in GLTF:  # which collision shapes cannot have either
                raise MeshError(f"mesh {name[:60]}: only .obj and .stl meshes are read in a URDF file: convert it")
            data = self.read(name)
            self.budget.add_file(data)
            try:
                self.meshes[name] = mesh_surfaces(name, data, lambda other: self.read(beside(name, other)), self.budget)
            except MeshError as error:
                raise MeshError(f"mesh {name[:60]}: {error}") from None
        return self.meshes[name]

    def _material(self, shape: Element) -> tuple[RGB | None, bytes]:
        """Colour and texture of a visual shape's <material>."""
        if not (given := shape.all("material")):
            return None, b""
        material, name = given[0], given[0].attributes.get("name", "")
        if not material.children and name:
            if name not in self.named:
                raise UrdfError(f"{material.place}: there is no material `{name[:60]}`")
            material = self.named[name]
        color: RGB | None = None
        if colors := material.all("color"):
            red, green, blue, _ = np.clip(numbers_of(colors[0], "rgba", 4), 0.0, 1.0).tolist()
            color = red, green, blue
        if not (textures := material.all("texture")):
            return color, b""
        file = textures[0].get("filename")
        if file not in self.textures:
            try:
                data = self.read(file)
                self.budget.add_file(data)
                self.budget.add_texture(data, file)
            except MeshError as error:
                raise UrdfError(f"{textures[0].place}: {error}") from None
            self.textures[file] = data
        return color or WHITE, self.textures[file]


def _scaled(surface: Surface, scale: Floats) -> Surface:
    flipped = float(np.prod(scale)) < 0.0
    faces = surface.faces[:, ::-1].copy() if flipped else surface.faces
    return replace(surface, vertices=surface.vertices * scale, faces=faces)
