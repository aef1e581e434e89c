"""A folder of assets: its index `assets.toml`, and what a mesh covers once it is scaled and turned upright."""

from __future__ import annotations

import difflib
import math
import re
import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, FiniteFloat, ValidationError

from scenegen.geometry import Footprint
from scenegen.things.meshfile import GLTF, MAX_FRICTION, MAX_MASS, MESH_FILES, MIN_MASS, Read, ending_of, mesh_points
from scenegen.things.outline import Floats, MeshError, Shadow
from scenegen.things.urdf import URDF_ENDING, RobotPlacement, robot_shadow

MAX_INDEX_BYTES = 16_000_000  # of an index: a hundred thousand entries
MAX_ASSET_SIZE, MIN_ASSET_SIZE = 20.0, 0.001  # metres: what is not between is in another unit
USUAL_SIZE = 2.0  # metres: sizes up to here are what a hint takes a mistaken unit to have meant
OTHER_UNITS = ((0.01, "centimetres"), (0.001, "millimetres"))
OFFSET_ROUNDING = 1e-9  # metres to which offsets are rounded, as outlines are

# Which axis of the file points up -> rows of the rotation that makes it z.
UPRIGHTS: Mapping[str, tuple[tuple[int, int, int], ...]] = {
    "x": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}


class IndexFileError(Exception):
    """The index cannot be used; the text says why, and in which line."""


class AssetSizeError(MeshError):
    """A size that no object on a table has: its largest in metres, and what to write instead."""

    def __init__(self, size: float, hint: str) -> None:
        super().__init__(f"it would measure {size:.3g} m" + (f"; {hint}" if hint else ""))
        self.size, self.hint = size, hint


def _inside(value: Any) -> Any:
    """A path that stays in the index's folder."""
    if isinstance(value, str):
        path = PurePosixPath(value.replace("\\", "/"))
        if path.is_absolute() or ".." in path.parts or ":" in value or "\0" in value:
            raise ValueError("its file must lie in the folder of the index: write a path relative to it")
    return value


def _not_bool(value: Any) -> Any:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError("expected a number")
    return value


def _several(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


Word = Annotated[str, Field(min_length=1, max_length=200, pattern=r'^[^/\\"\x00-\x1f]+$')]
Number = Annotated[FiniteFloat, BeforeValidator(_not_bool)]


class AssetEntry(BaseModel):
    """One asset: `scale` is how many metres a unit of its file is, `up` which axis of the file points up; it is then
    turned by `roll`, `pitch` and `yaw`, degrees about the fixed x, y and z axes in that order. With `center` the middle
    of its outline comes to its origin. `weight` says how often it is taken, compared with the others of its category.
    `mass` is in kg, `friction` the coefficient of sliding friction; without them, a
    URDF file's own count."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)
    name: Word
    file: Annotated[str, Field(min_length=1, max_length=1000), BeforeValidator(_inside)]
    category: Annotated[tuple[Word, ...], Field(min_length=1), BeforeValidator(_several)] | None = Field(
        default=None, strict=False
    )
    scale: Annotated[Number, Field(gt=0.0, le=1e6)] = 1.0
    up: Literal["x", "-x", "y", "-y", "z", "-z"] | None = None
    roll: Number = 0.0
    pitch: Number = 0.0
    yaw: Number = 0.0
    center: bool = False
    weight: Annotated[Number, Field(gt=0.0, le=1e6)] = 1.0
    mass: Annotated[Number, Field(ge=MIN_MASS, le=MAX_MASS)] | None = None
    friction: Annotated[Number, Field(ge=0.0, le=MAX_FRICTION)] | None = None

    @property
    def is_read(self) -> bool:
        """Whether its file is one that can be read."""
        return ending_of(self.file) in (*GLTF, *MESH_FILES, URDF_ENDING)

    @property
    def is_robot(self) -> bool:
        return ending_of(self.file) == URDF_ENDING

    @property
    def matrix(self) -> Floats:
        """(3, 3): from the vertices of the file, as they are read (z up), to metres in the object's frame."""
        return self.turn * self.scale

    @property
    def turn(self) -> Floats:
        """(3, 3): the rotation alone."""
        own = "y" if ending_of(self.file) in GLTF else "z"
        turn = np.array(UPRIGHTS[self.up or own], dtype=np.float64) @ np.array(UPRIGHTS[own], dtype=np.float64).T
        for axis, degrees in enumerate((self.roll, self.pitch, self.yaw)):
            turn = _rotation(axis, degrees) @ turn
        return turn


def _rotation(axis: int, degrees: float) -> Floats:
    quarters, rest = divmod(degrees, 90.0)
    angle = math.radians(degrees)
    exact = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarters) % 4]
    cos, sin = exact if not rest else (math.cos(angle), math.sin(angle))
    turn = np.eye(3)
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turn[[first, second], [first, second]] = cos
    turn[second, first], turn[first, second] = sin, -sin
    return turn


class _File(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)
    asset: Annotated[tuple[AssetEntry, ...], Field(min_length=1)]


@lru_cache(maxsize=8)
def read_index(data: bytes) -> Mapping[str, AssetEntry]:
    """The entries of an index by name, in its order. Raises IndexFileError."""
    if len(data) > MAX_INDEX_BYTES:
        raise IndexFileError(f"it is larger than {MAX_INDEX_BYTES:,} bytes")
    try:
        text = data.decode("utf-8-sig")
        found = _File.model_validate(tomllib.loads(text))
    except UnicodeDecodeError:
        raise IndexFileError("it is not UTF-8") from None
    except ValidationError as error:
        raise IndexFileError(_error_text(text, error.errors()[0])) from None
    except (ValueError, RecursionError) as error:
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else str(error).splitlines()[0]
        raise IndexFileError(f"it is not TOML: {reason[:200]}") from None
    entries: dict[str, AssetEntry] = {}
    for place, entry in enumerate(found.asset):
        if entry.name in entries:
            first = list(entries).index(entry.name)
            raise IndexFileError(f"{_where(text, place)}: a second `{entry.name}`; the first is {_where(text, first)}")
        entries[entry.name] = entry
    return entries


def categories(entries: Mapping[str, AssetEntry]) -> dict[str, list[str]]:
    """The names of the assets of each category, in the order of the index."""
    found: dict[str, list[str]] = {}
    for entry in entries.values():
        for category in dict.fromkeys(entry.category or ()):
            found.setdefault(category, []).append(entry.name)
    return found


def _where(text: str, place: int) -> str:
    """Which asset: with its line, where each has a header of its own."""
    headers = list(re.finditer(r"^[ \t]*\[\[[ \t]*asset[ \t]*\]\]", text, re.MULTILINE))
    line = f" (line {text.count(chr(10), 0, headers[place].start()) + 1})" if place < len(headers) else ""
    return f"asset {place + 1}{line}"


def _error_text(text: str, error: Any) -> str:
    """One of pydantic's errors in a line."""
    where = [part for part in error["loc"] if part != "asset"]
    reason = str(error["msg"]).removeprefix("Value error, ")
    reason = reason[:1].lower() + reason[1:]
    if error["type"] == "string_pattern_mismatch":
        reason = 'names have no `/`, `\\` and `"` in them'
    place = where[0] if where and isinstance(where[0], int) else None
    key = next((str(part) for part in reversed(where) if isinstance(part, str)), "")
    if error["type"] == "extra_forbidden":
        known = tuple(AssetEntry.model_fields if place is not None else ("asset",))
        near = difflib.get_close_matches(key, known, 1)
        reason = "there is no such key; " + (f"did you mean `{near[0]}`?" if near else f"there are {', '.join(known)}")
    elif place is not None and error["type"] == "model_type":
        reason = "expected a table with a name and a file"
    elif not where:
        reason = "it has no assets: each is a table [[asset]] with a name and a file"
    elif place is not None and error["type"] == "missing":
        reason = "is missing"
    head = "" if place is None else _where(text, place)
    return ": ".join(part for part in (head, f"`{key[:100]}`" if key else "", reason) if part)


@dataclass(frozen=True, slots=True, eq=False)
class FittedAsset:
    """What an asset covers of the table, and its height, in metres; `offset` (3,) takes its vertices, scaled and
    turned, to the object's frame: the lowest at z = 0."""

    footprint: Footprint
    height: float
    offset: Floats


def fit_asset(entry: AssetEntry, data: bytes, read: Read) -> FittedAsset:
    """The asset whose file has these bytes; `read` gives those of a file that a glTF or URDF names. Raises MeshError,
    AssetSizeError where it is far too large or small for a thing on a table, and what `read` raises."""
    if not entry.is_read:
        kind = f"{ending_of(entry.file)} files" if ending_of(entry.file) else "a file without an ending"
        known = "convert it to .glb, .gltf, .obj or .stl, with Blender or trimesh for instance"
        raise MeshError(f"{kind} cannot be read here: {known}")
    shadow_at = _robot_shadows(entry, data, read) if entry.is_robot else _mesh_shadows(entry, data, read)
    low, high = shadow_at(np.zeros(3)).spread
    _check_size(float((high - low).max()), entry.scale)
    middle = (low + high) / 2.0 if entry.center else np.zeros(3)
    offset = -np.round(np.array([middle[0], middle[1], low[2]]) / OFFSET_ROUNDING) * OFFSET_ROUNDING
    shadow = shadow_at(offset)
    height = round(shadow.top - shadow.bottom, 9)
    if height < MIN_ASSET_SIZE / 1000.0:
        raise MeshError("it has no height")
    return FittedAsset(shadow.footprint(), height, offset)


def _robot_shadows(entry: AssetEntry, data: bytes, read: Read) -> Callable[[Floats], Shadow]:
    known: dict[str, bytes] = {}

    def mesh(name: str) -> bytes:
        if name not in known:
            known[name] = read(name)
        return known[name]

    return lambda at: robot_shadow(data, mesh, RobotPlacement(entry.turn, entry.scale, at))


def _mesh_shadows(entry: AssetEntry, data: bytes, read: Read) -> Callable[[Floats], Shadow]:
    points = np.concatenate([part @ entry.matrix.T for part in mesh_points(entry.file, data, read)])

    def shadow_at(offset: Floats) -> Shadow:
        shadow = Shadow()
        shadow.points(np.eye(3), offset, points)
        return shadow

    return shadow_at


def _check_size(size: float, scale: float) -> None:
    if size > MAX_ASSET_SIZE:
        likely = [
            f"in {unit}? scale = {scale * factor:g}" for factor, unit in OTHER_UNITS if size * factor <= USUAL_SIZE
        ]
        raise AssetSizeError(size, f"is its file {'; '.join(likely)}" if likely else "")
    if size < MIN_ASSET_SIZE:
        raise AssetSizeError(
            size, f"is its file in metres? scale = {scale * 1000.0:g}" if size * 1000.0 <= USUAL_SIZE else ""
        )
