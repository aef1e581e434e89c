"""Render configurations: TOML with a value or a distribution for each part of a look."""

from __future__ import annotations

import colorsys
import difflib
import re
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from PIL import ImageColor
from pydantic import BaseModel, ConfigDict, PlainValidator, ValidationError, ValidationInfo, model_validator

from scenegen.errors import DataError, Source, Span
from scenegen.errors.files import BAD_LOOKS
from scenegen.looks.look import Draw, LookDistribution, Random, field_of
from scenegen.looks.textures import (
    IMAGE_ENDINGS,
    MAX_TEXTURE_BYTES,
    MAX_TEXTURES_BYTES,
    PLAIN,
    TEXTURE_NAMES,
    WOOD,
    check_image,
    list_files,
)
from scenegen.resources import note_input
from scenegen.scenes.files import below, read_bytes
from scenegen.things.colored_mesh import WHITE
from scenegen.things.library import RGB

MAX_NORMAL_DRAWS = 1000  # of a normal distribution, before the nearest value within its limits is taken
FORMS = "{uniform = [a, b]}, {normal = [mean, sd], within = [a, b]} or {choice = [...]}"


def constant_draw(value: Any) -> Draw:
    return lambda rng: value


def choice_draw(values: list[Any]) -> Draw:
    return lambda rng: values[int(rng.integers(len(values)))]


def choice_items(value: Any) -> list[Any] | None:
    """The items of {choice = [...]}, None for anything else. Raises ValueError."""
    if not (isinstance(value, dict) and set(value) == {"choice"}):
        return None
    items = value["choice"]
    if not (isinstance(items, list) and items):
        raise ValueError("choice takes a list of at least one value")
    return items


def number_draw(value: Any, low: float, high: float) -> Draw:
    """A number within limits. Raises ValueError."""
    items = choice_items(value)
    if items is not None:
        return choice_draw([_real(item, low, high) for item in items])
    if not isinstance(value, dict):
        return constant_draw(_real(value, low, high))
    if set(value) == {"uniform"}:
        a, b = _pair(value["uniform"], low, high)
        return lambda rng: float(rng.uniform(a, b))
    if set(value) == {"normal", "within"}:
        a, b = _pair(value["within"], low, high)
        given = value["normal"]
        if not (isinstance(given, list) and len(given) == 2):
            raise ValueError("normal takes [mean, sd]")
        return _normal(_real(given[0], low, high), _real(given[1], 0.0, 1e6), a, b)
    raise ValueError(f"expected a number, or {FORMS}")


def point_draw(value: Any, limits: tuple[tuple[float, float], ...]) -> Draw:
    """A point [x, y, z], each a number within its limits. Raises ValueError."""
    if not (isinstance(value, list) and len(value) == len(limits)):
        raise ValueError("expected [x, y, z] in metres, each a number or a distribution")
    draws = [number_draw(item, low, high) for item, (low, high) in zip(value, limits, strict=True)]
    return lambda rng: tuple(draw(rng) for draw in draws)


def color_draw(value: Any) -> Draw:
    """A colour. Raises ValueError."""
    items = choice_items(value)
    if items is not None:
        return choice_draw([_rgb(item) for item in items])
    if not (isinstance(value, dict) and set(value) == {"hsv"}):
        return constant_draw(_rgb(value))
    if not (isinstance(value["hsv"], list) and len(value["hsv"]) == 3):
        raise ValueError("hsv takes three ranges from 0 to 1: hue, saturation and value")
    box = [_pair(item, 0.0, 1.0) for item in value["hsv"]]
    return lambda rng: colorsys.hsv_to_rgb(*(float(rng.uniform(a, b)) for a, b in box))


def _real(value: Any, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or value != value:
        raise ValueError(f"expected a number from {low:g} to {high:g}, or {FORMS}")
    if not low <= value <= high:
        raise ValueError(f"it is not from {low:g} to {high:g}")
    return float(value)


def _pair(value: Any, low: float, high: float) -> tuple[float, float]:
    """[a, b] with a at most b."""
    if not (isinstance(value, list) and len(value) == 2):
        raise ValueError("expected two numbers, as [a, b]")
    first, second = (_real(item, low, high) for item in value)
    if first > second:
        raise ValueError(f"[{first:g}, {second:g}] is empty: write the smaller number first")
    return first, second


def _normal(mean: float, sd: float, low: float, high: float) -> Draw:
    def draw(rng: Random) -> float:
        value = mean
        for _ in range(MAX_NORMAL_DRAWS):
            value = float(rng.normal(mean, sd))
            if low <= value <= high:
                return value
        return min(max(value, low), high)

    return draw


def _rgb(value: Any) -> RGB:
    if not isinstance(value, str):
        raise ValueError('expected a colour: a name, "#rrggbb", {choice = [...]} or {hsv = [[a, b], [a, b], [a, b]]}')
    try:
        red, green, blue = ImageColor.getrgb(value)[:3]
    except ValueError:
        near = difflib.get_close_matches(value.lower(), ImageColor.colormap, 1)
        raise ValueError(f"`{value}` is no colour" + (f"; did you mean `{near[0]}`?" if near else "")) from None
    return red / 255.0, green / 255.0, blue / 255.0


PRESET = "random"
MAX_LOOKS_BYTES = 1_000_000
CAMERA_REACH = (-100.0, 100.0)  # metres: where a camera may be, along each axis
CAMERA_HEIGHT = (0.05, 100.0)  # metres above the table
PLACED = ("azimuth", "elevation", "distance")  # what a position takes the place of


@dataclass(slots=True)
class _Folder:
    """Where textures are read from, and those that were."""

    path: Path
    files: dict[str, bytes] = field(default_factory=dict)

    def read(self, name: str) -> str:
        if name not in self.files:
            try:
                path = below(self.path, name)
                note_input(path)
                data = path.read_bytes()
            except (OSError, ValueError) as error:
                reason = getattr(error, "strerror", None) or str(error)
                raise ValueError(f"cannot read {name}: {reason}") from None
            if len(data) > MAX_TEXTURE_BYTES:
                raise ValueError(f"{name} has more than {MAX_TEXTURE_BYTES:,} bytes")
            if sum(map(len, self.files.values())) + len(data) > MAX_TEXTURES_BYTES:
                raise ValueError(f"the textures have more than {MAX_TEXTURES_BYTES:,} bytes together")
            try:
                self.files[name] = check_image(data)
            except ValueError as error:
                raise ValueError(f"cannot use {name}: {error}") from None
        return name


def _number(low: float, high: float) -> PlainValidator:
    return PlainValidator(lambda value: number_draw(value, low, high))


def _point(*limits: tuple[float, float]) -> PlainValidator:
    return PlainValidator(lambda value: point_draw(value, limits))


def _texture(*known: str) -> PlainValidator:
    """A texture that is built in, or a picture from a file; several to choose from; or all files of a pattern."""
    words = ", ".join(f'"{name}"' for name in known)
    wanted = f'expected {words}, the name of a .png or .jpg file, {{choice = [...]}} or {{files = "FOLDER/*.jpg"}}'

    def read(value: Any, info: ValidationInfo) -> Draw:
        folder = info.context
        assert isinstance(folder, _Folder)
        if isinstance(value, dict) and set(value) == {"files"} and isinstance(value["files"], str):
            return choice_draw([folder.read(name) for name in list_files(folder.path, value["files"])])
        items = choice_items(value)
        for item in [value] if items is None else items:
            if isinstance(item, str) and item.lower().endswith(IMAGE_ENDINGS):
                folder.read(item)
            elif item not in known:
                near = difflib.get_close_matches(item, known, 1) if isinstance(item, str) else []
                raise ValueError(wanted + (f"; did you mean `{near[0]}`?" if near else ""))
        return constant_draw(value) if items is None else choice_draw(items)

    return PlainValidator(read)


Color = Annotated[Any, PlainValidator(color_draw)]
Size = Annotated[Any, _number(0.01, 100.0)]


class _LookPart(BaseModel):
    model_config = ConfigDict(extra="forbid")


class _Table(_LookPart):
    color: Color = None
    texture: Annotated[Any, _texture(WOOD, *TEXTURE_NAMES)] = constant_draw(WOOD)
    texture_size: Size = constant_draw(0.5)


class _Ground(_LookPart):
    color: Color = None
    texture: Annotated[Any, _texture(*TEXTURE_NAMES)] = constant_draw(PLAIN)
    texture_size: Size = constant_draw(1.0)


class _Walls(_LookPart):
    distance: Annotated[Any, _number(0.0, 20.0)] = constant_draw(0.6)
    color: Color = None
    texture: Annotated[Any, _texture(*TEXTURE_NAMES)] = constant_draw(PLAIN)
    texture_size: Size = constant_draw(1.0)


class _Light(_LookPart):
    azimuth: Annotated[Any, _number(-360.0, 360.0)] = constant_draw(-52.0)
    elevation: Annotated[Any, _number(35.0, 90.0)] = constant_draw(65.0)
    color: Color = constant_draw(WHITE)
    intensity: Annotated[Any, _number(0.0, 2.0)] = constant_draw(0.46)
    ambient: Annotated[Any, _number(0.0, 2.0)] = constant_draw(0.60)


class _Camera(_LookPart):
    azimuth: Annotated[Any, _number(-360.0, 360.0)] = constant_draw(0.0)
    elevation: Annotated[Any, _number(5.0, 89.0)] = constant_draw(50.0)
    distance: Annotated[Any, _number(1.0, 5.0)] = constant_draw(1.0)
    fov: Annotated[Any, _number(5.0, 100.0)] = constant_draw(32.0)
    focal_length: Annotated[Any, _number(11.0, 250.0)] = None
    position: Annotated[Any, _point(CAMERA_REACH, CAMERA_REACH, CAMERA_HEIGHT)] = None
    look_at: Annotated[Any, _point(CAMERA_REACH, CAMERA_REACH, CAMERA_REACH)] = None
    roll: Annotated[Any, _number(-180.0, 180.0)] = constant_draw(0.0)

    @model_validator(mode="after")
    def _fits(self) -> _Camera:
        given = self.model_fields_set
        if {"fov", "focal_length"} <= given:
            raise ValueError("fov and focal_length say the same: leave one out")
        clash = [name for name in PLACED if name in given]
        if "position" in given and clash:
            raise ValueError(f"a position takes the place of azimuth, elevation and distance: leave out {clash[0]}")
        if "look_at" in given and "position" not in given:
            raise ValueError("look_at goes with position")
        return self


class _Objects(_LookPart):
    hue: Annotated[Any, _number(-1.0, 1.0)] = constant_draw(0.0)
    saturation: Annotated[Any, _number(0.0, 4.0)] = constant_draw(1.0)
    brightness: Annotated[Any, _number(0.0, 4.0)] = constant_draw(1.0)


class _Config(_LookPart):
    table: _Table = _Table()
    ground: _Ground = _Ground()
    walls: _Walls = _Walls(distance=0.0)
    light: _Light = _Light()
    camera: _Camera = _Camera()
    objects: _Objects | None = None


LOOK_TABLES: dict[str, type[BaseModel]] = {
    "table": _Table,
    "ground": _Ground,
    "walls": _Walls,
    "light": _Light,
    "camera": _Camera,
    "objects": _Objects,
}

RANDOM_LOOKS = """
[table]
color = {hsv = [[0.02, 0.14], [0.1, 0.55], [0.4, 0.92]]}
texture = {choice = ["wood", "wood", "wood", "plain", "speckle"]}
texture_size = {uniform = [0.3, 0.8]}

[ground]
color = {hsv = [[0.0, 1.0], [0.0, 0.3], [0.35, 0.95]]}
texture = {choice = ["plain", "speckle", "checker", "stripes"]}
texture_size = {uniform = [0.5, 1.5]}

[walls]
distance = {choice = [0, 0.4, 0.8, 1.5]}
color = {hsv = [[0.0, 1.0], [0.0, 0.3], [0.5, 0.97]]}
texture = {choice = ["plain", "plain", "speckle", "stripes"]}
texture_size = {uniform = [0.4, 1.2]}

[light]
azimuth = {uniform = [-180, 180]}
elevation = {uniform = [45, 80]}
color = {choice = ["#ffffff", "#fff3e0", "#ffe8cc", "#e8f1ff"]}
intensity = {normal = [0.46, 0.1], within = [0.25, 0.65]}
ambient = {uniform = [0.45, 0.65]}

[camera]
azimuth = {normal = [0, 30], within = [-75, 75]}
elevation = {uniform = [25, 65]}
distance = {uniform = [1.0, 1.25]}
fov = {uniform = [25, 55]}
"""


def read_looks(source: str | Path) -> LookDistribution:
    """The distributions of a TOML file, or of the preset "random". Textures are found from the file's folder. Raises
    DataError."""
    if str(source) == PRESET:
        return _parse(PRESET, RANDOM_LOOKS, _Folder(Path()))
    path = Path(source)
    data = read_bytes(path, "looks", limit=MAX_LOOKS_BYTES)
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise DataError(
            BAD_LOOKS(Span(Source(str(path), ""), 0, 0), reason=f"it is not UTF-8: {error.reason}")
        ) from None
    return _parse(str(path), text, _Folder(path.parent))


def _parse(name: str, text: str, folder: _Folder) -> LookDistribution:
    source = Source(name, text)
    try:
        config = _Config.model_validate(tomllib.loads(text), context=folder)
    except ValidationError as error:
        raise DataError(*[_diagnostic(source, one) for one in error.errors()]) from None
    except (ValueError, RecursionError) as error:
        found = re.search(r"at line (\d+), column (\d+)", str(error))
        lines = text.splitlines(keepends=True)
        start = sum(map(len, lines[: int(found[1]) - 1])) + int(found[2]) - 1 if found else len(text)
        raise DataError(BAD_LOOKS(Span(source, start, start + 1), reason=f"{error}".splitlines()[0])) from None
    return LookDistribution(_fields(config), {} if config.objects is None else dict(config.objects), folder.files)


def _fields(config: _Config) -> dict[str, Draw]:
    """The draws of a look's fields."""
    drawn: dict[str, Draw] = {}
    for table in ("table", "ground", "walls", "light", "camera"):
        part = dict(getattr(config, table))
        drawn |= {f"{table}_{key}": draw for key, draw in part.items() if draw is not None}
    for table in ("table", "ground", "walls"):  # Looks.at: their colour depends on the texture
        drawn.setdefault(f"{table}_color", constant_draw(None))
    focal_length = drawn.pop("camera_focal_length", None)
    if focal_length is not None:
        drawn["camera_fov"] = lambda rng: field_of(focal_length(rng))
    return drawn


def _diagnostic(source: Source, error: Any) -> Any:
    """The diagnostic of one of pydantic's errors, at the line of its key."""
    loc = [str(part) for part in error["loc"]]
    reason = str(error["msg"]).removeprefix("Value error, ")
    if error["type"] == "extra_forbidden":
        model = _Config if len(loc) == 1 else LOOK_TABLES[loc[0]]
        near = difflib.get_close_matches(loc[-1], model.model_fields, 1)
        known = ", ".join(model.model_fields)
        reason = "there is no such key; " + (f"did you mean `{near[0]}`?" if near else f"there are {known}")
    elif len(loc) == 1 and error["type"] != "value_error":
        reason = f"expected a table, as [{loc[0]}]"
    return BAD_LOOKS(_place(source, loc), key=".".join(loc), reason=reason)


def _place(source: Source, loc: list[str]) -> Span:
    """The key in the text: below the header of its table, or dotted, or the table's header itself."""
    table, key = re.escape(loc[0]), re.escape(loc[-1])
    header = re.search(rf"^[ \t]*\[[ \t]*({table})[ \t]*\]", source.text, re.MULTILINE)
    found = None
    if len(loc) > 1 and header is not None:
        found = re.compile(rf"^[ \t]*({key})[ \t]*=", re.MULTILINE).search(source.text, header.end())
    if len(loc) > 1 and found is None:
        found = re.search(rf"^[ \t]*({table}[ \t]*\.[ \t]*{key})[ \t]*=", source.text, re.MULTILINE)
    found = found or header or re.search(rf"^[ \t]*({table})\b", source.text, re.MULTILINE)
    return Span(source, found.start(1), found.end(1)) if found else Span(source, 0, 1)
