"""A glTF file as JSON and buffers: items, arrays and images by their numbers, each checked before it is read."""

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

from scenegen.assets.mesh import Floats
from scenegen.assets.meshfile import FARTHEST, MeshError

MAGIC, JSON_CHUNK, BINARY_CHUNK = b"glTF", 0x4E4F534A, 0x004E4942
MOST_JSON = 16_000_000  # bytes of JSON
MOST_BYTES = 128_000_000  # of all buffers and images together
COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4}


@dataclass(frozen=True, slots=True)
class Item:
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

    def item(self, name: str, default: dict[str, Any] | None = None) -> Item:
        value = self.data.get(name, default)
        if not isinstance(value, dict):
            raise MeshError(f"{name} of {self.place} is missing, or no object")
        return Item(value, f"{name} of {self.place}")

    def items(self, name: str) -> list[Item]:
        value = self.data.get(name, [])
        if not isinstance(value, list) or not all(isinstance(one, dict) for one in value):
            raise MeshError(f"{name} of {self.place} is no list of objects")
        return [Item(one, f"{name}[{k}] of {self.place}") for k, one in enumerate(value)]

    def number(self, name: str, default: float) -> float:
        return float(Item({name: [self.data.get(name, default)]}, self.place).numbers(name, 1, ())[0])

    def numbers(self, name: str, count: int, default: Sequence[float]) -> Floats:
        value = self.data.get(name, default)
        numeric = isinstance(value, list | tuple) and all(type(one) in (int, float) for one in value)
        if not numeric or len(value) != count or not all(abs(one) <= FARTHEST for one in value):  # nor nan
            raise MeshError(
                f"{name} of {self.place} is not {count} numbers"
                if count > 1
                else f"{name} of {self.place} is not a number"
            )
        return np.array(value, dtype=np.float64)


@dataclass(slots=True)
class Document:
    root: Item
    binary: bytes | None
    read: Callable[[str], bytes]
    size: int = 0
    buffers: dict[int, bytes] = field(default_factory=dict)

    def count(self, name: str) -> int:
        value = self.root.data.get(name, [])
        if not isinstance(value, list):
            raise MeshError(f"its {name} are no list")
        return len(value)

    def item(self, name: str, number: int) -> Item:
        """One of the lists at the top, by number. Raises MeshError."""
        if number >= self.count(name):
            raise MeshError(f"it names {name}[{number}], and has {self.count(name)}")
        value = self.root.data[name][number]
        if not isinstance(value, dict):
            raise MeshError(f"{name}[{number}] is no object")
        return Item(value, f"{name}[{number}]")

    def required(self) -> list[str]:
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
        if code is None or not isinstance(form, str) or WIDTHS.get(form) != width:
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

    def _fetch(self, item: Item) -> bytes:
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
        if self.size > MOST_BYTES:
            raise MeshError(f"its buffers and textures are larger than {MOST_BYTES:,} bytes together")
        return data


def open_document(name: str, data: bytes, read: Callable[[str], bytes]) -> Document:
    """A .glb or .gltf file, by the ending of `name`; only its JSON is read. Raises MeshError."""
    binary = None
    text = data
    if PurePosixPath(name.replace("\\", "/")).suffix.lower() == ".glb":
        text, binary = _chunks(data)
    if len(text) > MOST_JSON:
        raise MeshError(f"its JSON is larger than {MOST_JSON:,} bytes")
    try:
        root = json.loads(text.decode("utf-8-sig"))
    except (ValueError, RecursionError):
        raise MeshError("its JSON is damaged") from None
    if not isinstance(root, dict):
        raise MeshError("its JSON is no object")
    document = Document(Item(root, "the file"), binary, read)
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
