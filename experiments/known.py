"""What was there before: the paper's tables, and the published weights as they were measured.

Accuracy is phi of the generated scenes minus the wanted phi, mean and standard deviation over 5,000 scenes, as printed
in van Waveren, Pek et al., "Generating Scenarios from High-Level Specifications for Object Rearrangement Tasks" (IROS
2023). The published weights were run on one core of another machine; see docs/experiments/README.md.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Known:
    """A row of figures that are not ours. `error` is (mean, std) per label, `absolute` the mean absolute error."""

    name: str
    family: str
    error: tuple[tuple[float, float], ...] = ()
    absolute: tuple[float, ...] = ()
    within: float | None = None
    coverage: float | None = None
    speed: float | None = None
    orderings: tuple[float, ...] = ()


KNOWN: dict[str, tuple[Known, ...]] = {
    "exp1": (
        Known("paper, GAN", "gan", ((-0.007, 0.038), (0.002, 0.035))),
        Known("paper, AAE", "aae", ((-0.085, 0.003), (0.117, 0.157))),
        Known("published weights, GAN", "gan", absolute=(0.015, 0.034), within=0.25, coverage=0.09, speed=226e3),
        Known("published weights, AAE", "aae", absolute=(0.097, 0.152), within=0.05, coverage=0.64, speed=580e3),
    ),
    "exp2": (
        Known("paper, GAN", "gan", ((-0.025, 0.030),)),
        Known("paper, AAE", "aae", ((-0.445, 0.271),)),
        Known("published code, GAN (retrained)", "gan", absolute=(0.061,), within=0.35, coverage=0.04),
        Known("published weights, AAE", "aae", absolute=(0.305,), within=0.125, coverage=0.13, speed=381e3),
    ),
    "exp3_3": (
        Known("paper, GAN", "gan", ((-0.016, 0.095),)),
        Known("paper, AAE", "aae", ((-0.052, 0.122),)),
        Known("published weights, GAN", "gan", absolute=(0.067,), within=0.21, coverage=0.34, speed=270e3),
    ),
    "exp3_5": (
        Known("paper, GAN", "gan", ((0.019, 0.093),)),
        Known("paper, AAE", "aae", ((-0.015, 0.068),)),
        Known("published weights, GAN", "gan", absolute=(0.100,), within=0.31, coverage=0.20, speed=270e3),
    ),
    "exp3_7": (
        Known("paper, GAN", "gan", ((-0.085, 0.106),)),
        Known("paper, AAE", "aae", ((-0.068, 0.063),)),
        Known("published weights, GAN", "gan", absolute=(0.098,), within=0.22, coverage=0.12, speed=270e3),
    ),
}

# scenes per second that really lie within 0.0125 of the wanted phi, same machine: plain numpy rejection, published
# model and filter
HITS: dict[str, tuple[float, float]] = {
    "exp1": (16_500, 9_500),
    "exp2": (11, 24_800),
    "exp3_3": (416_000, 27_000),
    "exp3_5": (37_800, 48_000),
    "exp3_7": (433, 28_000),
}
