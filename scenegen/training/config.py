"""What a training run is asked to do."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Any

from scenegen.data.table import DATASETS, is_file
from scenegen.errors import Diagnostic, RequestError, Source, Span, suggest
from scenegen.formats.table import FORMATS
from scenegen.given import path
from scenegen.models.table import MODELS, RECIPES, unknown
from scenegen.sampling.request import number
from scenegen.training.recipes import CONSTANT, DEFAULTS

# option -> lowest and highest value; whole numbers where the bounds are
BOUNDS: dict[str, tuple[float, float]] = {
    "epochs": (1, 1_000_000),
    "batch_size": (1, 1_000_000),
    "lr": (1e-8, 1.0),
    "seed": (0, 2**63 - 1),
    "scenes": (1, 10_000_000),
    "patience": (1, 1_000_000),
}
UNSET = ("scenes", "patience")  # options that may be None

WARM = 200  # steps
LEAST = 0.01  # of the rate, at the end


@dataclass(frozen=True, slots=True)
class TrainConfig:
    """`make_config` fills in what a recipe has for the model.

    `model` and `recipe` name an entry of RECIPES, `hyper` the model's own settings; `device` is `cpu`, `cuda` or
    `cuda:1`. `data` is an entry of DATASETS, of which `scenes` are drawn to train on, or a scene file, of which the
    first `scenes` are used (None: all). `patience` is after how many epochs without a smaller error of phi on held-out
    labels training stops (None: never); the model file then holds the best epoch. Raises RequestError with one
    diagnostic per value that is out of its range.
    """

    model: str
    recipe: str
    epochs: int
    batch_size: int
    lr: float
    scenes: int | None
    data: str
    seed: int = 0
    device: str = "cpu"
    patience: int | None = None
    hyper: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        found = [problem for name in BOUNDS if (problem := _check_number(name, getattr(self, name))) is not None]
        if is_file(self.data):
            found += _check_ending(self.data)
        elif self.data not in DATASETS:
            found.append(unknown("data set", self.data, DATASETS))
        elif self.scenes is None:
            found.append(Diagnostic(f"--scenes is missing: how many of `{self.data}` are to be drawn?"))
        if not re.fullmatch(r"cpu|cuda(:\d{1,3})?", str(self.device)):
            found.append(Diagnostic(f"unknown device `{self.device}`", help="write `cpu`, `cuda` or `cuda:1`"))
        if found:
            raise RequestError(*found)

    def rate(self, step: int, steps: int) -> float:
        """The learning rate of step 0, 1, .. of all the steps that are planned."""
        if self.recipe in CONSTANT:
            return self.lr
        warm = min(1.0, (step + 1) / WARM)
        return self.lr * warm * (LEAST + (1.0 - LEAST) * 0.5 * (1.0 + math.cos(math.pi * min(1.0, step / steps))))

    def differences(self, other: TrainConfig) -> list[tuple[str, object, object]]:
        """(name, own value, the other's value) of everything but the epochs that differs."""
        mine, theirs = asdict(self), asdict(other)
        names = [entry.name for entry in fields(self) if entry.name != "epochs"]
        return [(name, mine[name], theirs[name]) for name in names if mine[name] != theirs[name]]


def make_config(model: str, recipe: str = "default", **options: Any) -> TrainConfig:
    """The settings of a run: the recipe's for the model where an option is None or left out. Raises RequestError."""
    if recipe not in RECIPES:
        raise RequestError(unknown("recipe", recipe, RECIPES))
    if model not in RECIPES[recipe]:
        what = "model" if model not in MODELS else f"model of the {recipe} recipe"
        raise RequestError(unknown(what, model, RECIPES[recipe]))
    known = [entry.name for entry in fields(TrainConfig)][2:]
    for name in options:
        if name not in known:
            raise RequestError(unknown("option", name, known))
    given: dict[str, Any] = {name: _plain(value) for name, value in options.items() if value is not None}
    if isinstance(given.get("hyper"), Mapping):
        given["hyper"] = {name: _plain(value) for name, value in given["hyper"].items()}
    if not isinstance(given.get("data", ""), str):
        title = f"`data` is {given['data']!r}"
        raise RequestError(Diagnostic(title, help=f"it is {', '.join(DATASETS)}, or the path of a scene file"))
    if is_file(str(given.get("data", ""))):
        given = {"scenes": None, **given}  # all of them, not as many as the recipe draws
    return TrainConfig(model, recipe, **{**DEFAULTS[recipe, model], **given})


def parse_settings(options: Sequence[str]) -> dict[str, float]:
    """The model's own settings as typed, such as ["width=128"]. Raises RequestError with a caret."""
    found: dict[str, float] = {}
    for text in options:
        name, equals, rest = text.partition("=")
        value = number(rest)
        here = Span(Source("--hyper", text), len(name) + 1 if equals else 0, len(text))
        if value is None or not name.strip():
            title = "a setting is written NAME=VALUE, and its value is a number"
            raise RequestError(Diagnostic(title, here, "", "for instance width=128"))
        if name.strip() in found:
            raise RequestError(Diagnostic(f"`{name.strip()}` is set twice", here, "", "give each setting once"))
        found[name.strip()] = int(value) if value.is_integer() else value
    return found


def _plain(value: object) -> object:
    """Numbers of numpy as Python's, paths as text."""
    if isinstance(value, Integral) and not isinstance(value, bool):
        return int(value)
    if isinstance(value, Real) and not isinstance(value, bool):
        return float(value)
    return str(value) if isinstance(value, PathLike) else value


def _check_ending(data: str) -> list[Diagnostic]:
    known = path("data", data).suffix.lower() in FORMATS
    if not data.isascii() and data != data.encode(errors="replace").decode():
        return [Diagnostic(f"--data {data!a} is no text", help="rename the file: a model file names it, in UTF-8")]
    help_ = suggest(Path(data).suffix, FORMATS, f"use {', '.join(FORMATS)}")
    return [] if known else [Diagnostic(f"--data {data} has no ending of a format of scene files", help=help_)]


def _check_number(name: str, value: object) -> Diagnostic | None:
    if value is None and name in UNSET:
        return None
    lowest, highest = BOUNDS[name]
    whole = isinstance(lowest, int)
    option = f"--{name.replace('_', '-')}"
    fits = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if fits and math.isfinite(value) and lowest <= value <= highest:  # type: ignore[arg-type, operator]
        return None
    kind = "a whole number" if whole else "a number"
    span = f"{lowest:,} to {highest:,}" if whole else f"{lowest:g} to {highest:g}"
    help_ = {"seed": "the default is 0", "patience": "leave it out to train all epochs"}.get(
        name, "leave it out, and the recipe's own value is taken"
    )
    return Diagnostic(f"{option} is {value!r}; it must be {kind} from {span}", help=help_)
