"""What stands in a render configuration for one part of a look: a value or a distribution -> how it is drawn."""

from __future__ import annotations

import colorsys
import difflib
from typing import Any

from PIL import ImageColor

from scenegen.assets.palette import RGB
from scenegen.looks.look import Draw, Random

TRIES = 1000  # of a normal distribution, before the nearest value within its limits is taken
FORMS = "{uniform = [a, b]}, {normal = [mean, sd], within = [a, b]} or {choice = [...]}"


def fixed(value: Any) -> Draw:
    return lambda rng: value


def chosen(values: list[Any]) -> Draw:
    return lambda rng: values[int(rng.integers(len(values)))]


def choices(value: Any) -> list[Any] | None:
    """The items of {choice = [...]}, None for anything else. Raises ValueError."""
    if not (isinstance(value, dict) and set(value) == {"choice"}):
        return None
    items = value["choice"]
    if not (isinstance(items, list) and items):
        raise ValueError("choice takes a list of at least one value")
    return items


def number(value: Any, low: float, high: float) -> Draw:
    """A number within limits. Raises ValueError."""
    items = choices(value)
    if items is not None:
        return chosen([_real(item, low, high) for item in items])
    if not isinstance(value, dict):
        return fixed(_real(value, low, high))
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


def point(value: Any, limits: tuple[tuple[float, float], ...]) -> Draw:
    """A point [x, y, z], each a number within its limits. Raises ValueError."""
    if not (isinstance(value, list) and len(value) == len(limits)):
        raise ValueError("expected [x, y, z] in metres, each a number or a distribution")
    draws = [number(item, low, high) for item, (low, high) in zip(value, limits, strict=True)]
    return lambda rng: tuple(draw(rng) for draw in draws)


def color(value: Any) -> Draw:
    """A colour. Raises ValueError."""
    items = choices(value)
    if items is not None:
        return chosen([_rgb(item) for item in items])
    if not (isinstance(value, dict) and set(value) == {"hsv"}):
        return fixed(_rgb(value))
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
