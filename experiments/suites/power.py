"""How many episodes tell two policies apart: on the same starts of a suite, and on uniform starts of their own.

    python -m experiments.suites.power                                   # simulated policies
    python -m experiments.suites.power suites/tabletop a.jsonl b.jsonl   # recorded ones, two by two

For each pair: 200 repeats draw n episodes of each policy (with replacement, from its outcomes), and count how often the
difference is found at 95 %. Unpaired: n starts for each policy, independent, bands by their probabilities; chi-square
without correction, which finds more than Fisher's exact test. Paired: the same n starts for both; McNemar's exact test.
Chosen: the same, but after the first 50 starts, ten of each band, only bands go on in which the two together
succeed in 15 to 85 %. That choice knows nothing of which policy is better, so the test, given how many starts they
disagree on, stays exact. The smallest n with power 80 % counts, all episodes included. Until decided: the mean of how
many common starts are played where one looks after each and stops at `PairedDifference.is_decided`; this ends always.

Simulated policies succeed where latent > 0: a level, minus `slope` times how hard the start is (the quantile of phi as
a normal score), plus what else is in the start (`start`, the same for both policies), plus noise that follows the
start's seed (`shared`, the same for both), plus noise of their own (`own`). Levels are such that they succeed in 55 and
45 % of all starts.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from functools import cache
from itertools import combinations
from pathlib import Path
from statistics import NormalDist

import numpy as np
import numpy.typing as npt

from scenegen.arrays import Array, Index
from scenegen.learn.success.statistics import PairedDifference, Z, decided_after
from scenegen.play.suites.outcomes import read_outcomes
from scenegen.play.suites.suite import Suite

REPEATS, POWER, MOST = 200, 0.8, 4000
PILOT, DECIDED = 10, 0.15  # starts of a band before bands are chosen; shares of success that are near enough to 0 or 1
Outcome = npt.NDArray[np.bool_]  # (2, episodes)


@cache
def mcnemar(first: int, second: int) -> float:
    return PairedDifference(first, second, max(1, first + second)).p


def paired(success: Outcome, n: int, rng: np.random.Generator) -> float:
    """The share of repeats that find the difference on n common starts."""
    which = rng.integers(success.shape[1], size=(REPEATS, n))
    return told_apart([success[:, some] for some in which])


def chosen(success: Outcome, bands: Index, n: int, rng: np.random.Generator) -> float:
    """The same, with bands that are chosen after the first starts."""
    each = [np.flatnonzero(bands == band) for band in range(bands.max() + 1)]
    repeats = []
    for _ in range(REPEATS):
        first = [rng.choice(some, PILOT) for some in each]
        means = [success[:, some].mean() for some in first]
        go_on = [some for some, mean in zip(each, means, strict=True) if DECIDED <= mean <= 1.0 - DECIDED] or each
        more = rng.choice(np.concatenate(go_on), max(0, n - PILOT * len(each)))
        repeats.append(success[:, np.concatenate([*first, more])])
    return told_apart(repeats)


def until_decided(success: Outcome, rng: np.random.Generator) -> float:
    """The mean number of common starts that `suite run --until decided` plays."""
    stops = []
    for _ in range(REPEATS):
        one, other = success[:, rng.integers(success.shape[1], size=MOST)].tolist()
        stops.append(decided_after(range(MOST), dict(enumerate(one)), dict(enumerate(other))) or MOST)
    return float(np.mean(stops))


def told_apart(repeats: Sequence[Outcome]) -> float:
    counts = [(int((one & ~other).sum()), int((other & ~one).sum())) for one, other in repeats]
    return float(np.mean([mcnemar(*count) < 0.05 for count in counts]))


def unpaired(success: Outcome, weights: Array, n: int, rng: np.random.Generator) -> float:
    """The same on n starts for each, drawn by the probabilities of their bands."""
    shares = [rng.choice(one, size=(REPEATS, n), p=weights).mean(axis=1) for one in success]
    middle = (shares[0] + shares[1]) / 2.0
    error = np.sqrt(np.maximum(2.0 * middle * (1.0 - middle) / n, 1e-12))
    return float((np.abs(shares[0] - shares[1]) / error > Z).mean())


def needed(power: Callable[..., float], *given: object, seed: int) -> int:
    """The smallest n, to about 4 %, from which on the power suffices at three sizes in turn."""
    n, good, first = 16, 0, 0
    while n < MOST:
        enough = power(*given, n, np.random.default_rng([seed, n])) >= POWER
        good, first = (good + 1, first or n) if enough else (0, 0)
        if good == 3:
            return first
        n = max(n + 1, round(1.04 * n))
    return MOST


def line(name: str, success: Outcome, weights: Array, bands: Index, seed: int = 0) -> str:
    alone = needed(unpaired, success, weights, seed=seed)
    same, some = needed(paired, success, seed=seed), needed(chosen, success, bands, seed=seed)
    looks = until_decided(success, np.random.default_rng(seed))
    shares, disagree = success.mean(axis=1), (success[0] != success[1]).mean()
    facts = [*(f"{100 * one:.1f} %" for one in (*shares, disagree)), f"{alone:,}", f"{same:,}", f"{same / alone:.2f}"]
    return (
        "| "
        + " | ".join([name, *facts, f"{some:,}", f"{some / alone:.2f}", f"{looks:.0f}", f"{looks / alone:.2f}"])
        + " |"
    )


HEAD = """\
| policies | first | second | disagree | unpaired | paired | ratio | chosen bands | ratio | until decided | ratio |
| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |"""


def simulated(slope: float, start: float, shared: float, own: float, log10p: Array, seed: int) -> Outcome:
    rng = np.random.default_rng([seed, 2])
    harder = np.clip(10.0**log10p, 1e-6, 1.0 - 1e-6).tolist()
    score = -np.array([NormalDist().inv_cdf(one) for one in harder])  # 0 in the middle, higher where fewer are as hard
    common = -slope * score + start * rng.normal(size=len(log10p)) + shared * rng.logistic(size=len(log10p))
    latent = common + own * rng.logistic(size=(2, len(log10p)))
    return np.stack([one > np.quantile(one, share) for one, share in zip(latent, (0.45, 0.55), strict=True)])


def main(words: list[str]) -> None:
    suite = Suite.load(words[0] if words else "tabletop")
    cells = [suite.cells[number % len(suite.cells)] for number in range(len(suite))]
    weights = np.array([band.probability for _, band in cells])
    bands = np.array([task.bands.index(band) for task, band in cells])
    print(HEAD, flush=True)
    if not words:
        log10p = np.array([one.log10p for one in suite])
        for slope, start, shared, own in (
            (0, 0, 0, 1), (1, 0, 0, 1), (2, 0, 0, 1), (4, 0, 0, 1), (8, 0, 0, 1), (2, 2, 0, 1), (4, 4, 0, 1),
            (2, 2, 1, 0.25), (2, 2, 1, 0.5), (0, 0, 1, 0), (2, 2, 1, 0),
        ):  # fmt: skip
            name = f"slope {slope}, start {start}, shared {shared}, own {own}"
            success = simulated(slope, start, shared, own, log10p, 0)
            print(line(name, success, weights / weights.sum(), bands), flush=True)
        return
    read = {path: read_outcomes(Path(path), suite).success for path in words[1:]}
    for one, other in combinations(read, 2):
        common = sorted(read[one].keys() & read[other].keys())
        success = np.array([[read[path][k] for k in common] for path in (one, other)])
        name = f"{Path(one).stem}, {Path(other).stem}"
        print(line(name, success, weights[common] / weights[common].sum(), bands[common]), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
