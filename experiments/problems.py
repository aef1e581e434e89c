"""The paper's experiments as problems: a spec, a wanted phi, the paper's training settings, the bars to clear."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scenegen.api.spec import Spec

BAND = 0.0125  # half-width of the range that stands for "phi as wanted" in the truth and in what is handed out
ORDERINGS = ("left to right", "right to left", "upwards", "downwards")


@dataclass(frozen=True, slots=True)
class Bar:
    """What the best model must reach: mean absolute error of every label at most, coverage at least, scenes a second of
    its raw output, coverage of what is handed out, bytes of its file and CPU seconds of its training at most; where
    there are orderings, the share of each."""

    error: float
    coverage: float
    speed: float = 100_000.0
    handed_coverage: float = 0.90
    size: float = 1e6
    training: float | None = 300.0
    orderings: tuple[float, float] | None = None


@dataclass(frozen=True, slots=True)
class Problem:
    """`wanted` is phi per label; `batch`, `data` and `scenes` are the paper's training settings; `blocks` is the number
    of blocks to be in order, where that is what the spec is about."""

    key: str
    title: str
    spec: str
    wanted: Mapping[str, float]
    bar: Bar
    batch: int = 32
    data: str = "uniform"
    scenes: int = 20_000
    blocks: int = 0

    def load(self) -> Spec:
        """The spec, from those that ship with scenegen."""
        from scenegen.api.spec import load
        from scenegen.resources import shipped_specs

        return load(shipped_specs()[self.spec])

    @property
    def band(self) -> dict[str, tuple[float | None, float | None]]:
        """The range of every label that counts as what was wanted."""
        return {label: (value - BAND, value + BAND) for label, value in self.wanted.items()}


def _sorting(blocks: int, scenes: int) -> Problem:
    bar = Bar(0.015, 0.85, training=None, orderings=(0.20, 0.30))
    return Problem(
        f"exp3_{blocks}",
        f"Experiment 3, N = {blocks}, at 0.05",
        f"sort_{blocks}",
        {"sorted": 0.05},
        bar,
        data="boosted",
        scenes=scenes,
        blocks=blocks,
    )


PROBLEMS: dict[str, Problem] = {
    "exp1": Problem(
        "exp1",
        "Experiment 1 at (task, safe) = (0.19, 0.08)",
        "mug_left_of_plate",
        {"task": 0.19, "safe": 0.08},
        Bar(0.006, 0.90),
    ),
    "exp2": Problem(
        "exp2", "Experiment 2 at 0.03", "table_setting", {"task": 0.03}, Bar(0.008, 0.90), batch=512, data="boosted"
    ),
    "exp3_3": _sorting(3, 20_000),
    "exp3_5": _sorting(5, 61_867),
    "exp3_7": _sorting(7, 62_892),
}
