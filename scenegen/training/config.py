"""What a training run is asked to do."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields

from scenegen.data.table import DATASETS
from scenegen.errors import Diagnostic, RequestError, quoted, suggest
from scenegen.models.table import MODELS

# option -> lowest and highest value; whole numbers where the bounds are
BOUNDS: dict[str, tuple[float, float]] = {
    "epochs": (1, 1_000_000),
    "batch_size": (1, 1_000_000),
    "lr": (1e-8, 1.0),
    "seed": (0, 2**63 - 1),
    "scenes": (1, 10_000_000),
}


@dataclass(frozen=True, slots=True)
class TrainConfig:
    """The paper's settings by default: 50 epochs of Adam at lr 1e-3 in batches of 32 over 20,000 uniform scenes.

    `model` names an entry of MODELS, `hyper` its own settings, `data` an entry of DATASETS; `device` is `cpu`, `cuda`
    or `cuda:1`. Raises RequestError with one diagnostic per value that is out of its range.
    """

    model: str
    epochs: int = 50
    batch_size: int = 32
    lr: float = 1e-3
    seed: int = 0
    scenes: int = 20_000
    data: str = "uniform"
    device: str = "cpu"
    hyper: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        found = [problem for name in BOUNDS if (problem := _check_number(name, getattr(self, name))) is not None]
        for what, name, known in (("model", self.model, MODELS), ("data set", self.data, DATASETS)):
            if name not in known:
                otherwise = f"the {what}s are {quoted(known)}"
                found.append(Diagnostic(f"unknown {what} `{name}`", help=suggest(str(name), known, otherwise)))
        if not re.fullmatch(r"cpu|cuda(:\d{1,3})?", str(self.device)):
            found.append(Diagnostic(f"unknown device `{self.device}`", help="write `cpu`, `cuda` or `cuda:1`"))
        if found:
            raise RequestError(*found)

    def differences(self, other: TrainConfig) -> list[tuple[str, object, object]]:
        """(name, own value, the other's value) of everything but the epochs that differs."""
        mine, theirs = asdict(self), asdict(other)
        names = [entry.name for entry in fields(self) if entry.name != "epochs"]
        return [(name, mine[name], theirs[name]) for name in names if mine[name] != theirs[name]]


def _check_number(name: str, value: object) -> Diagnostic | None:
    lowest, highest = BOUNDS[name]
    whole = isinstance(lowest, int)
    option = f"--{name.replace('_', '-')}"
    fits = isinstance(value, int if whole else int | float) and not isinstance(value, bool)
    if fits and math.isfinite(value) and lowest <= value <= highest:  # type: ignore[arg-type, operator]
        return None
    kind = "a whole number" if whole else "a number"
    span = f"{lowest:,} to {highest:,}" if whole else f"{lowest:g} to {highest:g}"
    usual = TrainConfig.__dataclass_fields__[name].default
    return Diagnostic(f"{option} is {value!r}; it must be {kind} from {span}", help=f"the default is {usual:,}")
