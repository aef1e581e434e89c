"""What a training run is asked to do, and what each model is trained with unless told otherwise. No torch.

The fields of `TrainConfig` are options of `scenegen train`.
"""

from __future__ import annotations

import importlib
import math
import os
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from numbers import Integral, Real
from os import PathLike
from pathlib import Path
from typing import Annotated, Any

from scenegen.errors import Diagnostic, RequestError, Source, Span
from scenegen.errors.files import UNKNOWN_ENDING
from scenegen.errors.learning import UNKNOWN_DEVICE
from scenegen.errors.requests import (
    ARGUMENT_SYNTAX,
    CONFLICTING_ARGUMENTS,
    GIVEN_TWICE,
    MISSING_ARGUMENT,
    OUT_OF_RANGE,
    UNKNOWN_CHOICE,
    WRONG_VALUE,
)
from scenegen.learn.models.registry import MODELS
from scenegen.sampling.request import number
from scenegen.scenes.formats.registry import FORMATS
from scenegen.validation import Option, as_path

# Exact scenes, balanced in phi; the rate warms up, then falls along a cosine.
BASE: Mapping[str, object] = {"epochs": 16, "batch_size": 512, "lr": 1e-3, "scenes": 200_000, "data": "balanced"}
FLOW: Mapping[str, object] = {**BASE, "epochs": 36, "scenes": 100_000}
# What has learnt from many specs needs little of one.
TUNING: Mapping[str, object] = {**BASE, "epochs": 1, "batch_size": 128, "lr": 5e-4, "scenes": 6_000}
# Games want many steps more than large batches.
GAMES: Mapping[str, object] = {**BASE, "batch_size": 256, "epochs": 8}

DEFAULTS: dict[str, Mapping[str, object]] = {
    "gan": GAMES,
    "aae": {**GAMES, "epochs": 6},
    "flow": FLOW,
    "any": TUNING,
}

GATHERING = "gathering exact scenes"
"""What a run says that it does for GATHER_SECONDS of CPU time at most. It cannot tell how long it will take: it draws
scenes that are ever rarer, and only a batch that has begun has an estimate."""
GATHER_SECONDS = 110.0


# The table of data sets. A new one is one file and one line here.


# Text, not functions: `scenegen train --help` lists them without importing torch. Each makes so many labelled scenes:
# (spec, scenes, generator, gathering=None) -> Dataset. The generator (a CPU one) alone determines the outcome; it
# reports its progress to the gathering, which may end it with RequestError.
DATASETS: dict[str, str] = {
    "balanced": "scenegen.learn.training.balanced:draw_balanced",
    "uniform": "scenegen.learn.training.dataset:uniform",
}


def is_file(data: str) -> bool:
    """Whether `--data` names a scene file rather than an entry of DATASETS."""
    return data not in DATASETS and (bool(Path(data).suffix) or os.sep in data)


def dataset_maker(name: str) -> Callable[..., Any]:
    """The function of a data set by name. Raises RequestError, with the nearest name, for one not in DATASETS."""
    if name not in DATASETS:
        raise RequestError(UNKNOWN_CHOICE(what="data set", name=name, known=DATASETS))
    module, _, attribute = DATASETS[name].partition(":")
    maker: Callable[..., Any] = getattr(importlib.import_module(module), attribute)
    return maker


# What a training run is asked to do.


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

WARM_STEPS = 200  # steps
FINAL_RATE_SHARE = 0.01  # of the rate, at the end


def parse_settings(options: Sequence[str]) -> dict[str, float]:
    """The model's own settings as typed, such as ["width=128"]. Raises RequestError with a caret."""
    found: dict[str, float] = {}
    for text in options:
        name, equals, rest = text.partition("=")
        value = number(rest)
        here = Span(Source("hyper", text, argument=True), len(name) + 1 if equals else 0, len(text))
        if value is None or not name.strip():
            raise RequestError(
                ARGUMENT_SYNTAX(here, what="a setting", form="NAME=VALUE, with a number", example="width=128")
            )
        if name.strip() in found:
            raise RequestError(GIVEN_TWICE(here, what=f"the setting `{name.strip()}`"))
        found[name.strip()] = int(value) if value.is_integer() else value
    return found


@dataclass(frozen=True, slots=True)
class TrainConfig:
    """`make_config` fills in the model's defaults.

    `model` names an entry of MODELS, `hyper` the model's own settings; `device` is `cpu`, `cuda` or
    `cuda:1`. `data` is an entry of DATASETS, of which `scenes` are drawn to train on, or a scene file, of which the
    first `scenes` are used (None: all). `phi` are ranges by label, as text (`0:0.2`), in which most of the scenes of
    `balanced` are to lie. `patience` is after how many epochs without a smaller error of phi on held-out
    labels training stops (None: never); the model file then holds the best epoch. Raises RequestError with one
    diagnostic per value that is out of its range.
    """

    model: Annotated[
        str,
        Option("flow, gan or aae; any tunes the model of any spec to yours.", "NAME", hints=MODELS),
    ]
    epochs: Annotated[int, Option("Passes over the training scenes.", typed=int | None)]
    batch_size: Annotated[int, Option("Scenes per step.", typed=int | None)]
    lr: Annotated[float, Option("Learning rate of Adam.", typed=float | None)]
    scenes: Annotated[int | None, Option("Training scenes; of a file the first so many, all if left out.")]
    data: Annotated[
        str,
        Option(
            "balanced: exact, flat in phi; uniform; or a file of scenes (.parquet of any size, .jsonl, .json).",
            "NAME|FILE",
            typed=str | None,
        ),
    ]
    seed: Annotated[int, Option("Of everything random; the same seed gives the same model.")] = 0
    device: Annotated[str, Option("cpu, cuda or cuda:1.")] = "cpu"
    patience: Annotated[
        int | None,
        Option(
            "Stop after so many epochs without a smaller error of phi on held-out labels, and keep the best; left "
            "out, all epochs are run and the last is kept.",
            "EPOCHS",
        ),
    ] = None
    hyper: Annotated[
        Mapping[str, float],
        Option(
            "A setting of the model, as width=128; repeat for more. `scenegen explain models` lists all.",
            "NAME=VALUE",
            typed=list[str] | None,
            parse=parse_settings,
        ),
    ] = field(default_factory=dict)
    phi: Annotated[
        Mapping[str, str],
        Option(
            "Where to train: most of the training scenes lie in LO:HI, LO: or :HI; NAME=LO:HI names a label.",
            "[NAME=]LO:HI",
            typed=list[str] | None,
        ),
    ] = field(default_factory=dict)

    def __post_init__(self) -> None:
        found = [problem for name in BOUNDS if (problem := _check_number(name, getattr(self, name))) is not None]
        if is_file(self.data):
            found += _check_ending(self.data)
        elif self.data not in DATASETS:
            found.append(UNKNOWN_CHOICE(what="data set", name=self.data, known=DATASETS))
        elif self.scenes is None:
            question = f"how many of `{self.data}` are to be drawn?"
            found.append(MISSING_ARGUMENT(argument="scenes", question=question))
        if self.phi and self.data != "balanced":
            found.append(CONFLICTING_ARGUMENTS(one="phi", other="data"))
        if not re.fullmatch(r"cpu|cuda(:\d{1,3})?", str(self.device)):
            found.append(UNKNOWN_DEVICE(name=str(self.device)))
        if found:
            raise RequestError(*found)

    def rate(self, step: int, steps: int) -> float:
        """The learning rate of step 0, 1, .. of all the steps that are planned."""
        warm = min(1.0, (step + 1) / WARM_STEPS)
        return (
            self.lr
            * warm
            * (FINAL_RATE_SHARE + (1.0 - FINAL_RATE_SHARE) * 0.5 * (1.0 + math.cos(math.pi * min(1.0, step / steps))))
        )

    def differences(self, other: TrainConfig) -> list[tuple[str, object, object]]:
        """(name, own value, the other's value) of everything but the epochs that differs."""
        mine, theirs = asdict(self), asdict(other)
        names = [entry.name for entry in fields(self) if entry.name != "epochs"]
        return [(name, mine[name], theirs[name]) for name in names if mine[name] != theirs[name]]


def make_config(model: str, **options: Any) -> TrainConfig:
    """The settings of a run: the model's defaults where an option is None or left out. Raises RequestError."""
    if model not in MODELS:
        raise RequestError(UNKNOWN_CHOICE(what="model", name=model, known=MODELS))
    known = [entry.name for entry in fields(TrainConfig)][1:]
    for name in options:
        if name not in known:
            raise RequestError(UNKNOWN_CHOICE(what="option", name=name, known=known))
    given: dict[str, Any] = {name: _plain(value) for name, value in options.items() if value is not None}
    if isinstance(given.get("hyper"), Mapping):
        given["hyper"] = {name: _plain(value) for name, value in given["hyper"].items()}
    if not isinstance(given.get("data", ""), str):
        wanted = f"one of {', '.join(DATASETS)}, or the path of a scene file"
        raise RequestError(WRONG_VALUE(argument="data", value=repr(given["data"]), wanted=wanted))
    if is_file(str(given.get("data", ""))):
        given = {"scenes": None, **given}  # all of them, not as many as are drawn
    return TrainConfig(model, **{**DEFAULTS[model], **given})


def _plain(value: object) -> object:
    """Numbers of numpy as Python's, paths as text."""
    if isinstance(value, Integral) and not isinstance(value, bool):
        return int(value)
    if isinstance(value, Real) and not isinstance(value, bool):
        return float(value)
    return str(value) if isinstance(value, PathLike) else value


def _check_ending(data: str) -> list[Diagnostic]:
    ending = as_path("data", data).suffix
    if not data.isascii() and data != data.encode(errors="replace").decode():
        return [WRONG_VALUE(argument="data", value=ascii(data), wanted="a name in UTF-8: a model file holds it")]
    return [] if ending.lower() in FORMATS else [UNKNOWN_ENDING(path=data, name=ending, known=FORMATS, what="scene")]


def _check_number(name: str, value: object) -> Diagnostic | None:
    if value is None and name in UNSET:
        return None
    lowest, highest = BOUNDS[name]
    whole = isinstance(lowest, int)
    if isinstance(value, int | float) and (isinstance(value, int) or not whole) and not isinstance(value, bool):
        fits = math.isfinite(value) and lowest <= value <= highest
    else:
        fits = False
    if fits:
        return None
    kind = "a whole number" if whole else "a number"
    span = f"{lowest:,} to {highest:,}" if whole else f"{lowest:g} to {highest:g}"
    hint = {"seed": "the default is 0", "patience": "leave it out to train all epochs"}.get(
        name, "leave it out, and the model's own value is taken"
    )
    return OUT_OF_RANGE(argument=name, value=repr(value), wanted=f"{kind} from {span}", hint=hint)
