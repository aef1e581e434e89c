"""The surfaces of glTF 2.0 files, .glb and .gltf: triangles, base colours and base textures of what its scene shows.

Everything is measured before it is read: a file of a few hundred bytes can announce gigabytes. The format:
https://registry.khronos.org/glTF/specs/2.0/glTF-2.0.html.
"""

from __future__ import annotations

import base64
import binascii
import json
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import PurePosixPath
from typing import Any
from urllib.parse import unquote

import numpy as np
import numpy.typing as npt

from scenegen.things.colored_mesh import MAX_MESH_COORDINATE, WHITE, ColoredMesh, MeshBudget, tidy
from scenegen.things.library import RGB
from scenegen.things.outline import Floats, Indices, MeshError

MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942
MAX_GLTF_JSON_BYTES = 16_000_000  # bytes of JSON
MAX_BUFFER_BYTES = 128_000_000  # of all buffers and images together
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
ACCESSOR_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True, slots=True)
class GltfItem:
    """An object of the JSON; `place` says where it stands there. Every method raises MeshError for what is not so."""

    data: dict[str, Any]
    place: str

    def index(self, name: str, default: int | None = None) -> int:
        """A whole number that is not negative."""
        value = self.data.get(name, default)
        if type(value) is not int or value < 0:
            raise MeshError(f"{name} of {self.place} is missing, or no whole number from 0")
        return value

    def indices(self, name: str) -> list[int]:
        value = self.data.get(name, [])
        if not isinstance(value, list) or any(type(one) is not int or one < 0 for one in value):
            raise MeshError(f"{name} of {self.place} is no list of whole numbers from 0")
        return value

    def item(self, name: str, default: dict[str, Any] | None = None) -> GltfItem:
        value = self.data.get(name, default)
        if not isinstance(value, dict):
            raise MeshError(f"{name} of {self.place} is missing, or no object")
        return GltfItem(value, f"{name} of {self.place}")

    def items(self, name: str) -> list[GltfItem]:
        value = self.data.get(name, [])
        if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
            raise MeshError(f"{name} of {self.place} is no list of objects")
        return [GltfItem(one, f"{name}[{k}] of {self.place}") for k, one in enumerate(value)]

    def number(self, name: str, default: float) -> float:
        return float(GltfItem({name: [self.data.get(name, default)]}, self.place).numbers(name, 1, ())[0])

    def numbers(self, name: str, count: int, default: Sequence[float]) -> Floats:
        value = self.data.get(name, default)
        numeric = isinstance(value, list | tuple) and all(type(one) in (int, float) for one in value)
        if not numeric or len(value) != count or not all(abs(one) <= MAX_MESH_COORDINATE for one in value):  # nor nan
            raise MeshError(
                f"{name} of {self.place} is not {count} numbers"
                if count > 1
                else f"{name} of {self.place} is not a number"
            )
        return np.array(value, dtype=np.float64)


@dataclass(slots=True)
class GltfDocument:
    root: GltfItem
    binary: bytes | None
    read: Callable[[str], bytes]
    size: int = 0
    buffers: dict[int, bytes] = field(default_factory=dict)

    def count(self, name: str) -> int:
        value = self.root.data.get(name, [])
        if not isinstance(value, list):
            raise MeshError(f"its {name} are no list")
        return len(value)

    def item(self, name: str, number: int) -> GltfItem:
        """One of the lists at the top, by number. Raises MeshError."""
        if number >= self.count(name):
            raise MeshError(f"it names {name}[{number}], and has {self.count(name)}")
        value = self.root.data[name][number]
        if not isinstance(value, dict):
            raise MeshError(f"{name}[{number}] is no object")
        return GltfItem(value, f"{name}[{number}]")

    def required_extensions(self) -> list[str]:
        value = self.root.data.get("extensionsRequired", [])
        if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
            raise MeshError("its extensionsRequired are no list of names")
        return value

    def length(self, accessor: int) -> int:
        return self.item("accessors", accessor).index("count")

    def array(self, number: int, width: int) -> Floats:
        """An accessor's values, (count, width). Raises MeshError, before memory is taken for what is not there."""
        accessor = self.item("accessors", number)
        if "sparse" in accessor.data or "bufferView" not in accessor.data:
            raise MeshError(f"{accessor.place} has sparse or no data, which is not read here")
        kind, form = accessor.data.get("componentType"), accessor.data.get("type")
        code = COMPONENTS.get(kind) if type(kind) is int else None
        if code is None or not isinstance(form, str) or ACCESSOR_WIDTHS.get(form) != width:
            raise MeshError(f"{accessor.place} has values of the wrong type")
        count, start = accessor.index("count"), accessor.index("byteOffset", 0)
        view = self._view(accessor.index("bufferView"))
        dtype = np.dtype(code)
        row = width * dtype.itemsize
        stride = self.item("bufferViews", accessor.index("bufferView")).index("byteStride", row)
        if stride < row or (count and start + (count - 1) * stride + row > len(view)):
            raise MeshError(f"{accessor.place} ends outside its buffer: the file is cut short or damaged")
        if not count:
            return np.empty((0, width))
        held = np.ndarray((count, width), dtype, view, start, (stride if count > 1 else row, dtype.itemsize))
        values = held.astype(np.float64)
        if accessor.data.get("normalized") is True and dtype.kind in "iu":
            values = np.maximum(values / np.iinfo(dtype).max, -1.0)
        return values

    def image(self, number: int) -> bytes:
        """The bytes of an image. Raises MeshError."""
        image = self.item("images", number)
        if "bufferView" in image.data:
            return bytes(self._view(image.index("bufferView")))
        return self._fetch(image)

    def _view(self, number: int) -> memoryview:
        view = self.item("bufferViews", number)
        which, start, length = view.index("buffer"), view.index("byteOffset", 0), view.index("byteLength")
        if which not in self.buffers:
            buffer = self.item("buffers", which)
            if "uri" in buffer.data:
                self.buffers[which] = self._fetch(buffer)
            elif which == 0 and self.binary is not None:
                self.buffers[which] = self.binary
            else:
                raise MeshError(f"{buffer.place} has no data")
        if start + length > len(self.buffers[which]):
            raise MeshError(f"{view.place} ends outside its buffer: the file is cut short or damaged")
        return memoryview(self.buffers[which])[start : start + length]

    def _fetch(self, item: GltfItem) -> bytes:
        """What the `uri` of a buffer or image says, or names. Raises MeshError."""
        uri = item.data.get("uri")
        if not isinstance(uri, str) or not uri:
            raise MeshError(f"{item.place} has no data")
        if uri.startswith("data:"):
            head, comma, body = uri.partition(",")
            try:
                if not comma or not head.endswith(";base64"):
                    raise ValueError
                data = base64.b64decode(body, validate=True)
            except (ValueError, binascii.Error):
                raise MeshError(f"the data in {item.place} is not in base64") from None
        elif "://" in uri or uri.startswith(("/", "\\", "file:")):
            raise MeshError(f"{item.place} names {uri[:60]}; only files beside it, or in folders there, are read")
        else:
            data = self.read(unquote(uri).replace("\\", "/"))
        self.size += len(data)
        if self.size > MAX_BUFFER_BYTES:
            raise MeshError(f"its buffers and textures are larger than {MAX_BUFFER_BYTES:,} bytes together")
        return data


def open_document(name: str, data: bytes, read: Callable[[str], bytes]) -> GltfDocument:
    """A .glb or .gltf file, by the ending of `name`; only its JSON is read. Raises MeshError."""
    binary = None
    text = data
    if PurePosixPath(name.replace("\\", "/")).suffix.lower() == ".glb":
        text, binary = _chunks(data)
    if len(text) > MAX_GLTF_JSON_BYTES:
        raise MeshError(f"its JSON is larger than {MAX_GLTF_JSON_BYTES:,} bytes")
    try:
        root = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        raise MeshError("its JSON is damaged") from None
    if not isinstance(root, dict):
        raise MeshError("its JSON is no object")
    document = GltfDocument(GltfItem(root, "the file"), binary, read)
    version = document.root.item("asset").data.get("version")
    if not isinstance(version, str) or version.partition(".")[0] != "2":
        raise MeshError("it is not glTF 2.0")
    return document


def _chunks(data: bytes) -> tuple[bytes, bytes | None]:
    """The JSON and the binary chunk of a .glb file. Raises MeshError."""
    if len(data) < 20 or data[:4] != MAGIC:
        raise MeshError("it is no GLB file")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise MeshError("it is not glTF 2.0")
    if length > len(data):
        raise MeshError("it is cut short")
    found: dict[int, bytes] = {}
    at = 12
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > length:
            raise MeshError("it is cut short")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    if JSON_CHUNK not in found:
        raise MeshError("it is no GLB file")
    return found[JSON_CHUNK], found.get(BINARY_CHUNK)


MAX_GLTF_NODES = 20_000
MAX_GLTF_PARTS = 10_000  # with a material each, of all meshes together, counted as often as they are placed
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
REPEAT_MODE = 10497  # the usual wrap mode of a texture
UV_SLACK = 1e-3  # of a texture's size, by which places may lie outside it where it does not repeat
TRIANGLES, STRIP, FAN = 4, 5, 6  # the modes of a primitive that have faces


@dataclass(slots=True)
class _GltfReader:
    document: GltfDocument
    budget: MeshBudget = field(default_factory=MeshBudget)
    textures: dict[int, bytes] = field(default_factory=dict)

    def surfaces(self) -> list[ColoredMesh]:
        parts: list[tuple[GltfItem, Floats]] = []
        for node, turn in self._nodes():
            if "skin" in node.data:
                raise MeshError("it moves by a skeleton (a skin): apply it before the export")
            if "mesh" in node.data:
                mesh = self.document.item("meshes", node.index("mesh"))
                parts += [(part, turn) for part in mesh.items("primitives")]
            if len(parts) > MAX_GLTF_PARTS:  # before any of them is read
                raise MeshError(f"its meshes have more than {MAX_GLTF_PARTS:,} parts together")
        read = (self._surface(part, turn) for part, turn in parts)
        found = [surface for surface in read if surface is not None]
        if not found:
            raise MeshError("no node of its scene has triangles")
        return found

    def _nodes(self) -> list[tuple[GltfItem, Floats]]:
        """The nodes of the scene that is shown, each with its place (4, 4) in it."""
        document = self.document
        count = document.count("nodes")
        if count > MAX_GLTF_NODES:
            raise MeshError(f"it has more than {MAX_GLTF_NODES:,} nodes")
        if document.count("scenes"):
            roots = document.item("scenes", document.root.index("scene", 0)).indices("nodes")
        else:
            below = {child for k in range(count) for child in document.item("nodes", k).indices("children")}
            roots = [k for k in range(count) if k not in below]
        seen = set(roots)
        if len(seen) < len(roots):
            raise MeshError("its scene names a node twice")
        found = [(document.item("nodes", root), _node_matrix(document.item("nodes", root))) for root in roots]
        for node, turn in found:  # grows while it is walked
            for child in node.indices("children"):
                if child in seen:
                    raise MeshError(f"node {child} has two parents, or is its own")
                seen.add(child)
                one = document.item("nodes", child)
                found.append((one, turn @ _node_matrix(one)))
        return found

    def _surface(self, part: GltfItem, turn: Floats) -> ColoredMesh | None:
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
        if not np.isfinite(placed).all() or np.abs(placed).max() > MAX_MESH_COORDINATE:
            raise MeshError("a coordinate in it is no number, or beyond all measure")
        if np.linalg.det(turn[:3, :3]) < 0.0:
            faces = faces[:, ::-1].copy()
        color, image = self._material(part)
        texture, uv = (b"", None) if image is None else self._texture(image, attributes, len(points))
        x, y, z = placed.T  # y points up in glTF
        return tidy(ColoredMesh(np.column_stack([x, -z, y]), faces, color, uv, texture))

    def _material(self, part: GltfItem) -> tuple[RGB, GltfItem | None]:
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

    def _texture(self, image: GltfItem, attributes: GltfItem, count: int) -> tuple[bytes, Floats]:
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
        sampler = document.item("samplers", texture.index("sampler")) if "sampler" in texture.data else GltfItem({}, "")
        for axis, mode in enumerate(("wrapS", "wrapT")):
            outside = uv[:, axis].min(initial=0.0) < -UV_SLACK or uv[:, axis].max(initial=1.0) > 1.0 + UV_SLACK
            if outside and sampler.index(mode, REPEAT_MODE) != REPEAT_MODE:
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


def surfaces(name: str, data: bytes, read: Callable[[str], bytes]) -> tuple[ColoredMesh, ...]:
    """What a .glb or .gltf file shows, turned so that z points up (glTF's front, +z, then looks along -y).

    `read` gives the bytes of a file that it names, relative to it; what that raises passes through. Animations,
    cameras, lights, morphs and all of a material but its base colour are left out. Raises MeshError.
    """
    document = open_document(name, data, read)
    for extension in document.required_extensions():
        if extension not in (*HARMLESS, DIFFUSE, MOVED):
            raise MeshError(f"it needs the extension {extension}, which is not read here: export it without")
    with np.errstate(all="ignore"):  # what overflows is found as no number
        return tuple(_GltfReader(document).surfaces())


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


def _node_matrix(node: GltfItem) -> Floats:
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
