"""Render configurations: TOML with a number, a name or a distribution for each part of a look."""

from __future__ import annotations

import colorsys
import difflib
import re
import tomllib
from pathlib import Path
from typing import Annotated, Any

from PIL import ImageColor
from pydantic import BaseModel, ConfigDict, PlainValidator, ValidationError

from scenegen.assets.palette import RGB
from scenegen.errors import DataError, Source, Span
from scenegen.errors.files import BAD_LOOKS
from scenegen.formats.files import read_bytes
from scenegen.render.looks import Draw, Looks, Random

PRESET = "random"
MAX_BYTES = 1_000_000
TRIES = 1000  # of a normal distribution, before the nearest value within its limits is taken
FORMS = "{uniform = [a, b]}, {normal = [mean, sd], within = [a, b]} or {choice = [...]}"
TEXTURES = ("wood", "plain")


def _fixed(value: Any) -> Draw:
    return lambda rng: value


def _chosen(values: list[Any]) -> Draw:
    return lambda rng: values[int(rng.integers(len(values)))]


def _choices(value: Any) -> list[Any] | None:
    """The items of {choice = [...]}, None for anything else. Raises ValueError."""
    if not (isinstance(value, dict) and set(value) == {"choice"}):
        return None
    items = value["choice"]
    if not (isinstance(items, list) and items):
        raise ValueError("choice takes a list of at least one value")
    return items


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


def _number(low: float, high: float) -> PlainValidator:
    def read(value: Any) -> Draw:
        items = _choices(value)
        if items is not None:
            return _chosen([_real(item, low, high) for item in items])
        if not isinstance(value, dict):
            return _fixed(_real(value, low, high))
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

    return PlainValidator(read)


def _normal(mean: float, sd: float, low: float, high: float) -> Draw:
    def draw(rng: Random) -> float:
        value = mean
        for _ in range(TRIES):
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


def _color(value: Any) -> Draw:
    items = _choices(value)
    if items is not None:
        return _chosen([_rgb(item) for item in items])
    if not (isinstance(value, dict) and set(value) == {"hsv"}):
        return _fixed(_rgb(value))
    if not (isinstance(value["hsv"], list) and len(value["hsv"]) == 3):
        raise ValueError("hsv takes three ranges from 0 to 1: hue, saturation and value")
    box = [_pair(item, 0.0, 1.0) for item in value["hsv"]]
    return lambda rng: colorsys.hsv_to_rgb(*(float(rng.uniform(a, b)) for a, b in box))


def _texture(value: Any) -> Draw:
    items = _choices(value)
    for item in [value] if items is None else items:
        if item not in TEXTURES:
            raise ValueError('expected "wood", "plain" or {choice = [...]} of them')
    return _fixed(value) if items is None else _chosen(items)


Color = Annotated[Any, PlainValidator(_color)]


class _Table(BaseModel):
    model_config = ConfigDict(extra="forbid")
    color: Color = _fixed((0.83, 0.72, 0.58))
    texture: Annotated[Any, PlainValidator(_texture)] = _fixed("wood")


class _Ground(BaseModel):
    model_config = ConfigDict(extra="forbid")
    color: Color = _fixed((0.935, 0.932, 0.925))


class _Light(BaseModel):
    model_config = ConfigDict(extra="forbid")
    azimuth: Annotated[Any, _number(-360.0, 360.0)] = _fixed(-52.0)
    elevation: Annotated[Any, _number(35.0, 90.0)] = _fixed(65.0)
    color: Color = _fixed((1.0, 1.0, 1.0))
    intensity: Annotated[Any, _number(0.0, 2.0)] = _fixed(0.46)
    ambient: Annotated[Any, _number(0.0, 2.0)] = _fixed(0.60)


class _Camera(BaseModel):
    model_config = ConfigDict(extra="forbid")
    azimuth: Annotated[Any, _number(-360.0, 360.0)] = _fixed(0.0)
    elevation: Annotated[Any, _number(5.0, 89.0)] = _fixed(50.0)
    distance: Annotated[Any, _number(1.0, 5.0)] = _fixed(1.0)
    fov: Annotated[Any, _number(5.0, 100.0)] = _fixed(32.0)


class _Config(BaseModel):
    model_config = ConfigDict(extra="forbid")
    table: _Table = _Table()
    ground: _Ground = _Ground()
    light: _Light = _Light()
    camera: _Camera = _Camera()


RANDOM = """
[table]
color = {hsv = [[0.02, 0.14], [0.1, 0.55], [0.4, 0.92]]}
texture = {choice = ["wood", "wood", "plain"]}

[ground]
color = {hsv = [[0.0, 1.0], [0.0, 0.3], [0.35, 0.95]]}

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


def read_looks(source: str | Path) -> Looks:
    """The distributions of a TOML file, or of the preset "random". Raises DataError."""
    if str(source) == PRESET:
        return _parsed(PRESET, RANDOM)
    path = Path(source)
    data = read_bytes(path, "looks", limit=MAX_BYTES)
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise DataError(
            BAD_LOOKS(Span(Source(str(path), ""), 0, 0), reason=f"it is not UTF-8: {error.reason}")
        ) from None
    return _parsed(str(path), text)


def _parsed(name: str, text: str) -> Looks:
    source = Source(name, text)
    try:
        config = _Config.model_validate(tomllib.loads(text))
    except ValidationError as error:
        raise DataError(*[_said(source, one) for one in error.errors()]) from None
    except (ValueError, RecursionError) as error:
        found = re.search(r"at line (\d+), column (\d+)", str(error))
        lines = text.splitlines(keepends=True)
        start = sum(map(len, lines[: int(found[1]) - 1])) + int(found[2]) - 1 if found else len(text)
        raise DataError(BAD_LOOKS(Span(source, start, start + 1), reason=f"{error}".splitlines()[0])) from None
    parts = {table: getattr(config, table) for table in _Config.model_fields}
    return Looks(
        {f"{table}_{key}": getattr(part, key) for table, part in parts.items() for key in type(part).model_fields}
    )


def _said(source: Source, error: Any) -> Any:
    """The diagnostic of one of pydantic's errors, at the line of its key."""
    loc = [str(part) for part in error["loc"]]
    reason = str(error["msg"]).removeprefix("Value error, ")
    if error["type"] == "extra_forbidden":
        model = _Config if len(loc) == 1 else _Config.model_fields[loc[0]].annotation
        assert isinstance(model, type) and issubclass(model, BaseModel)
        near = difflib.get_close_matches(loc[-1], model.model_fields, 1)
        known = ", ".join(model.model_fields)
        reason = "there is no such key; " + (f"did you mean `{near[0]}`?" if near else f"there are {known}")
    elif len(loc) == 1:
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
