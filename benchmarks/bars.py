"""How often the error bars of `scenegen range` hold the truth, on problems whose probabilities a formula gives.

    python benchmarks/bars.py [--seeds 100] [--only NAME] [--effort 1e8]

Each problem is measured with every seed; a bar is half of a 95 % interval, so 95 of 100 should hold. Values of phi of
one run share their levels, so their misses come together: the standard error in the table is that of independent runs.
`sd` is the scatter of log10 over the seeds, `bar` the root mean square of the bars; `low` and `high` are the shares of
estimates that lie beyond their bars on either side. `--effort` limits the growth runs (node visits; the product allows
5e8), because a hundred of them take long; their bars are computed in the same way.
"""

from __future__ import annotations

import argparse
import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.lang.checker import check_text
from scenegen.sampling.growth import rarity
from scenegen.sampling.rarity import RequirementUnmet, measure
from scenegen.sampling.report import Estimate

Law = Callable[[float], float]


@dataclass(frozen=True)
class Case:
    """`laws` give log10 P(phi >= t) by label, at the values of phi in `places`; `required` is log10 P(requirement)."""

    text: str
    laws: dict[str, Law]
    places: dict[str, Sequence[float]]
    required: float | None = None
    growth: bool = False


def one(power: int) -> Law:
    """Of the least of so many independent differences of two uniform numbers."""
    return lambda t: power * math.log10((1.0 - t) ** 2 / 2.0)


def near(t: float) -> float:
    """Of 0.5 less the distance of two uniform points of the unit square."""
    s = 0.5 - t
    return math.log10(math.pi * s**2 - 8.0 / 3.0 * s**3 + s**4 / 2.0)


def row(count: int) -> Law:
    """Of the least gap of uniform numbers in a given order."""
    return lambda t: count * math.log10(1.0 - (count - 1) * t) - math.log10(math.factorial(count))


def in_row(count: int, relation: str, what: str = "p") -> str:
    return f"forall i in 1..{count - 1}: {relation.format(f'{what}[i]', f'{what}[i + 1]')}"


RODS = (
    "object rod[10] = cylinder(0.02, 0.1)\nworkspace [0, 1] x [0, 0.000001]\nrequire noOverlap()\n"
    f"task: {in_row(10, 'leftOf({0}, {1})', 'rod')}"
)
CASES = {
    "difference": Case("leftOf(a, b)", {"task": one(1)}, {"task": (0.2, 0.6, 0.9, 0.99)}),
    "distance": Case("closeTo(a, b, 0.5)", {"task": near}, {"task": (0.1, 0.3, 0.45, 0.49)}),
    "two differences": Case(
        "leftOf(a, b) & aboveOf(a, b)", {"task": one(2)}, {"task": (0.2, 0.4, 0.6, 0.8, 0.9, 0.95)}
    ),
    "four differences": Case(
        "leftOf(a, b) & aboveOf(a, b) & leftOf(c, d) & aboveOf(c, d)", {"task": one(4)}, {"task": (0.2, 0.5, 0.7, 0.9)}
    ),
    "required": Case(
        "require leftOf(a, b)\ntask: rightOf(c, b)",
        {"task": lambda t: math.log10((1.0 - t) ** 3 / 3.0)},
        {"task": (0.1, 0.5, 0.9)},
        math.log10(0.5),
    ),
    "rarely required, two labels": Case(
        "require x(a) + 0.8 <= x(b)\nfirst: leftOf(a, b)\nsecond: aboveOf(a, b)",
        {"first": lambda t: 2.0 * math.log10((1.0 - t) / 0.2), "second": one(1)},
        {"first": (0.9, 0.95, 0.98), "second": (0.2, 0.6, 0.9)},
        math.log10(0.02),
    ),
    "12 in a row (growth)": Case(
        f"object p[12]\ntask: {in_row(12, 'leftOf({0}, {1})')}",
        {"task": row(12)},
        {"task": (0.0, 0.02, 0.05)},
        growth=True,
    ),
    "10 rods (growth)": Case(
        RODS,
        {"task": lambda t: row(10)(t) - 10.0 * math.log10(1.0 - 9.0 * 0.04)},
        {"task": (0.04, 0.06, 0.08)},
        10.0 * math.log10(1.0 - 9.0 * 0.04),
        growth=True,
    ),
}


def estimates(case: Case, seed: int) -> list[tuple[float, Estimate | None]]:
    """The truth and the estimate of each place, and of the requirement."""
    spec = check_text(case.text)
    if case.growth:
        found = rarity.measure_by_growth(spec, spec.labels, seed, up_only=True)
    else:
        split = measure(spec.core, *spec.box(), spec.labels, seed)
        assert not isinstance(split, RequirementUnmet)
        found = split
    pairs = [(law(t), found.reaches[label].up(t)) for label, law in case.laws.items() for t in case.places[label]]
    return pairs if case.required is None else [*pairs, (case.required, found.requirement)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=100)
    parser.add_argument("--only", default="")
    parser.add_argument("--effort", type=float, default=1e8)
    options = parser.parse_args()
    rarity.TAIL_EFFORT = options.effort
    print(
        "| problem | log10 P | held | +- | low | high | off by | sd | bar / 2 |\n|---|---|---|---|---|---|---|---|---|"
    )
    seconds, every = time.process_time(), []
    for name, case in CASES.items():
        if options.only not in name:
            continue
        rows = [estimates(case, seed) for seed in range(options.seeds)]
        off = np.array([[np.nan if e is None else e.log10 - truth for truth, e in row] for row in rows])
        bar = np.array([[np.nan if e is None else e.error for _, e in row] for row in rows])
        missing = int(np.isnan(off).sum())
        held, low, high = np.abs(off) <= bar, off < -bar, off > bar
        every.append(held.mean())
        depth = [truth for truth, _ in rows[0]]
        error = held.mean(axis=1).std(ddof=1) / math.sqrt(len(held))
        print(
            f"| {name} | {max(depth):.1f} to {min(depth):.1f} | {held.mean():.3f} | {error:.3f} | {low.mean():.3f} "
            f"| {high.mean():.3f} | {np.nanmean(off):+.4f} | {np.sqrt(np.nanmean(np.nanvar(off, axis=0))):.4f} "
            f"| {np.sqrt(np.nanmean(bar**2)) / 2.0:.4f} |" + (f" {missing} untold" if missing else ""),
            flush=True,
        )
    print(f"\nheld on average: {np.mean(every):.3f}; {time.process_time() - seconds:.0f} CPU s")


if __name__ == "__main__":
    main()
