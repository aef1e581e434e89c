"""The surfaces of glTF 2.0 files, .glb and .gltf: triangles, base colours and base textures of what its scene shows.

Everything is measured before it is read: a file of a few hundred bytes can announce gigabytes. The format:
https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from scenegen.assets.gltf_document import Document, Item, open_document
from scenegen.assets.mesh import Floats, Indices
from scenegen.assets.meshfile import FARTHEST, MeshError
from scenegen.assets.palette import RGB
from scenegen.assets.surface import WHITE, Budget, Surface, tidy

MOST_NODES = 20_000
MOST_PARTS = 10_000  # with a material each, of all meshes together, counted as often as they are placed
# What a file may require of its readers: what is read here is the same without it.
HARMLESS = (
    *(
        f"KHR_materials_{one}"
        for one in "anisotropy clearcoat diffuse_transmission dispersion emissive_strength ior iridescence sheen "
        "specular transmission unlit variants volume".split()
    ),
    "KHR_mesh_quantization",
    "KHR_lights_punctual",
    "KHR_xmp",
    "KHR_xmp_json_ld",
)
DIFFUSE, MOVED = "KHR_materials_pbrSpecularGlossiness", "KHR_texture_transform"  # these are read
REPEAT = 10497  # the usual wrap mode of a texture
SLACK = 1e-3  # of a texture's size, by which places may lie outside it where it does not repeat
TRIANGLES, STRIP, FAN = 4, 5, 6  # the modes of a primitive that have faces


@dataclass(slots=True)
class _Reader:
    document: Document
    budget: Budget = field(default_factory=Budget)
    textures: dict[int, bytes] = field(default_factory=dict)

    def surfaces(self) -> list[Surface]:
        parts: list[tuple[Item, Floats]] = []
        for node, turn in self._nodes():
            if "skin" in node.data:
                raise MeshError("it moves by a skeleton (a skin): apply it before the export")
            if "mesh" in node.data:
                mesh = self.document.item("meshes", node.index("mesh"))
                parts += [(part, turn) for part in mesh.items("primitives")]
            if len(parts) > MOST_PARTS:  # before any of them is read
                raise MeshError(f"its meshes have more than {MOST_PARTS:,} parts together")
        read = (self._surface(part, turn) for part, turn in parts)
        found = [surface for surface in read if surface is not None]
        if not found:
            raise MeshError("no node of its scene has triangles")
        return found

    def _nodes(self) -> list[tuple[Item, Floats]]:
        """The nodes of the scene that is shown, each with its place (4, 4) in it."""
        document = self.document
        count = document.count("nodes")
        if count > MOST_NODES:
            raise MeshError(f"it has more than {MOST_NODES:,} nodes")
        if document.count("scenes"):
            roots = document.item("scenes", document.root.index("scene", 0)).indices("nodes")
        else:
            below = {child for k in range(count) for child in document.item("nodes", k).indices("children")}
            roots = [k for k in range(count) if k not in below]
        seen = set(roots)
        if len(seen) < len(roots):
            raise MeshError("its scene names a node twice")
        found = [(document.item("nodes", root), _placed(document.item("nodes", root))) for root in roots]
        for node, turn in found:  # grows while it is walked
            for child in node.indices("children"):
                if child in seen:
                    raise MeshError(f"node {child} has two parents, or is its own")
                seen.add(child)
                one = document.item("nodes", child)
                found.append((one, turn @ _placed(one)))
        return found

    def _surface(self, part: Item, turn: Floats) -> Surface | None:
        mode = part.index("mode", TRIANGLES)
        if mode not in (TRIANGLES, STRIP, FAN):  # points and lines
            return None
        attributes = part.item("attributes")
        document = self.document
        at = attributes.index("POSITION")
        self.budget.add_vertices(document.length(at))
        given = part.index("indices") if "indices" in part.data else None
        corners = document.length(at if given is None else given)
        self.budget.add_triangles(corners // 3 if mode == TRIANGLES else max(corners - 2, 0))
        points = document.array(at, 3)
        order = np.arange(corners) if given is None else document.array(given, 1)[:, 0].astype(np.int64)
        if order.size and int(order.max()) >= len(points):
            raise MeshError(f"a triangle in it names vertex {int(order.max())} of {len(points)}")
        faces = _faces(order, mode)
        if not len(faces):
            return None
        placed = points @ turn[:3, :3].T + turn[:3, 3]
        if not np.isfinite(placed).all() or np.abs(placed).max() > FARTHEST:
            raise MeshError("a coordinate in it is no number, or beyond all measure")
        if np.linalg.det(turn[:3, :3]) < 0.0:
            faces = faces[:, ::-1].copy()
        color, image = self._material(part)
        texture, uv = (b"", None) if image is None else self._texture(image, attributes, len(points))
        x, y, z = placed.T  # y points up in glTF
        return tidy(Surface(np.column_stack([x, -z, y]), faces, color, uv, texture))

    def _material(self, part: Item) -> tuple[RGB, Item | None]:
        """Base colour, and what the material says of its texture."""
        if "material" not in part.data:
            return WHITE, None
        material = self.document.item("materials", part.index("material"))
        older = material.item("extensions", {})
        if DIFFUSE in older.data:
            paint, factor, image = older.item(DIFFUSE), "diffuseFactor", "diffuseTexture"
        else:
            paint, factor, image = material.item("pbrMetallicRoughness", {}), "baseColorFactor", "baseColorTexture"
        red, green, blue, _ = np.clip(paint.numbers(factor, 4, (1.0, 1.0, 1.0, 1.0)), 0.0, 1.0).tolist()
        return (red, green, blue), paint.item(image) if image in paint.data else None

    def _texture(self, image: Item, attributes: Item, count: int) -> tuple[bytes, Floats]:
        """The file of a texture, and the places (count, 2) of the vertices in it."""
        document = self.document
        texture = document.item("textures", image.index("index"))
        if "source" not in texture.data:
            raise MeshError("a texture in it is neither PNG nor JPEG")
        moved = image.item("extensions", {}).item(MOVED, {})
        name = f"TEXCOORD_{moved.index('texCoord', image.index('texCoord', 0))}"
        if name not in attributes.data:
            raise MeshError(f"a mesh in it has a texture, but no {name} that says where")
        where = attributes.index(name)
        uv = document.array(where, 2) if document.length(where) == count else None
        if uv is None or not np.isfinite(uv).all():
            raise MeshError(f"its {name} does not fit its vertices")
        if moved.data:
            angle = moved.number("rotation", 0.0)
            cos, sin = np.cos(angle), np.sin(angle)
            uv = uv * moved.numbers("scale", 2, (1.0, 1.0)) @ np.array([[cos, -sin], [sin, cos]])
            uv = uv + moved.numbers("offset", 2, (0.0, 0.0))
        sampler = document.item("samplers", texture.index("sampler")) if "sampler" in texture.data else Item({}, "")
        for axis, mode in enumerate(("wrapS", "wrapT")):
            outside = uv[:, axis].min(initial=0.0) < -SLACK or uv[:, axis].max(initial=1.0) > 1.0 + SLACK
            if outside and sampler.index(mode, REPEAT) != REPEAT:
                raise MeshError(
                    f"{texture.place} does not repeat ({mode} of its sampler), and a mesh reaches beyond its edge, "
                    "which is not read here: export it with places in the texture from 0 to 1"
                )
        return self._image(texture.index("source")), uv

    def _image(self, number: int) -> bytes:
        if number not in self.textures:
            data = self.document.image(number)
            self.budget.add_texture(data, f"texture {number} in it")
            self.textures[number] = data
        return self.textures[number]


def surfaces(name: str, data: bytes, read: Callable[[str], bytes]) -> tuple[Surface, ...]:
    """What a .glb or .gltf file shows, turned so that z points up (glTF's front, +z, then looks along -y).

    `read` gives the bytes of a file that it names, relative to it; what that raises passes through. Animations,
    cameras, lights, morphs and all of a material but its base colour are left out. Raises MeshError.
    """
    document = open_document(name, data, read)
    for extension in document.required():
        if extension not in (*HARMLESS, DIFFUSE, MOVED):
            raise MeshError(f"it needs the extension {extension}, which is not read here: export it without")
    with np.errstate(all="ignore"):  # what overflows is found as no number
        return tuple(_Reader(document).surfaces())


def _faces(order: Indices, mode: int) -> Indices:
    if mode == TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    if len(order) < 3:
        return np.empty((0, 3), dtype=np.int64)
    if mode == FAN:
        return np.column_stack([np.full(len(order) - 2, order[0]), order[1:-1], order[2:]])
    faces = np.column_stack([order[:-2], order[1:-1], order[2:]])
    faces[1::2] = faces[1::2, [1, 0, 2]]  # every other triangle of a strip is the other way round
    return faces


def _placed(node: Item) -> Floats:
    """The (4, 4) matrix of a node in its parent's frame."""
    if "matrix" in node.data:
        return node.numbers("matrix", 16, ()).reshape(4, 4).T
    x, y, z, w = node.numbers("rotation", 4, (0.0, 0.0, 0.0, 1.0)).tolist()
    norm = float(np.sqrt(x * x + y * y + z * z + w * w))
    if not norm:
        raise MeshError("a rotation in it is all zeros")
    x, y, z, w = x / norm, y / norm, z / norm, w / norm
    turn = np.array(
        [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ]
    )
    whole: npt.NDArray[np.float64] = np.eye(4)
    whole[:3, :3] = turn * node.numbers("scale", 3, (1.0, 1.0, 1.0))
    whole[:3, 3] = node.numbers("translation", 3, (0.0, 0.0, 0.0))
    return whole
