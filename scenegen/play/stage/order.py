"""An order of starts in which few things have to be moved far from one to the next.

A start costs as far as its things are from where they stand in the one before; a thing that only one of both has is
fetched or put away. The shortest such walk through all is that of a travelling salesman: nearest next, then 2-opt
(Croes 1958) until no exchange of two steps is shorter.
"""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from pathlib import Path

import numpy as np

from scenegen.arrays import Array, Index
from scenegen.errors import DataError
from scenegen.errors.files import NOT_SCENES
from scenegen.errors.worlds import NOT_A_SUITE
from scenegen.learn.success.files import Letter
from scenegen.play.stage.stage import TableStage
from scenegen.play.suites.outcomes import LETTERS, EpisodeOrder
from scenegen.play.suites.suite import GradedStart, Suite
from scenegen.scenes.files import read_bytes
from scenegen.scenes.formats.tables import read_table

FETCH_DISTANCE = 0.3  # metres: to fetch a thing or to put it away
SWEEPS_OF_ORDER = 30
LEAST_GAIN = 1e-9  # metres


def order_starts(suite: Suite, starts: Sequence[GradedStart]) -> list[GradedStart]:
    """The same starts, of which the first stays first."""
    between = _travel(suite, starts)
    order = _nearest_next(between)
    for _ in range(SWEEPS_OF_ORDER):
        if not _shorten(order, between):
            break
    return [starts[which] for which in order]


def travel_of(suite: Suite, starts: Sequence[GradedStart]) -> float:
    """How far things are moved from one start to the next, on the mean, in metres."""
    between = _travel(suite, starts)
    return float(np.diag(between, 1).mean()) if len(starts) > 1 else 0.0


def write_order(suite: Suite, starts: Sequence[GradedStart], pairs: bool) -> tuple[bytes, bytes]:
    """A table of trials, and with `pairs` one of the letters of two policies: each start is two trials in succession,
    and the suite's digest draws which policy has the first of them."""
    rng = np.random.default_rng(int(suite.digest[:12], 16))
    trials, letters = ["trial,episode,task,band"], ["trial,policy"]
    for start in starts:
        for which in rng.permutation(2) if pairs else [0]:
            letters.append(f"{len(trials)},{LETTERS[which]}")
            trials.append(f'{len(trials)},{start.number},"{start.task.name}","{start.band}"')
    return "\n".join([*trials, ""]).encode(), "\n".join([*letters, ""]).encode()


def key_of(path: Path) -> Path:
    """Where the letters of the trials in a table are."""
    return path.with_name(f"{path.stem}.key.csv")


def read_order(path: Path, suite: Suite, allowed: Collection[int], blind: Letter | None = None) -> EpisodeOrder:
    """The episodes of such a table that are allowed, each once, in its order: its first trial, or the one of the policy
    that is called `blind`. Raises DataError."""
    what, file = f"an order of the suite {suite.name}", read_bytes(path, "an order of episodes")
    table = read_table(path, "an order of episodes", NOT_SCENES)
    episodes = [int(one) for one in table.column("episode")]
    beyond = [number for number in episodes if not 0 <= number < len(suite)]
    if beyond:
        reason = f"it has episode {beyond[0]}, and the suite has {len(suite):,}"
        raise DataError(NOT_A_SUITE(file=path, what=what, reason=reason))
    letters = _read_letters(key_of(path), len(episodes)) if blind else []
    trials: dict[int, int] = {}
    for place, number in enumerate(episodes):
        if number in allowed and (not blind or letters[place] == blind):
            trials.setdefault(number, place + 1)
    if not trials:
        raise DataError(NOT_A_SUITE(file=path, what=what, reason="it has none of these episodes"))
    return EpisodeOrder(trials, hashlib.sha256(file).hexdigest(), blind)


def _read_letters(path: Path, count: int) -> list[str]:
    """The letters of so many trials. Raises DataError."""
    table = read_table(path, "the key of an order", NOT_SCENES)
    letters = [str(one).strip() for one in table.cells("policy")] if "policy" in table.names else []
    if len(letters) != count or not set(letters) <= {*LETTERS}:
        reason = f"it has not the letters of {count:,} trials, A or B"
        raise DataError(NOT_A_SUITE(file=path, what="the key of this order", reason=reason))
    return letters


def _travel(suite: Suite, starts: Sequence[GradedStart]) -> Array:
    """(S, S): from each start to each other."""
    stage = TableStage.from_suite(suite)
    places = np.full((len(stage.things), len(starts), 2), np.nan)
    for column, start in enumerate(starts):
        poses = start.task.scenes.poses[start.row]
        for which in range(len(start.objects)):
            places[stage.things.index(stage.thing(start.task.spec.checked, which)), column] = poses[which, :2]
    total = np.zeros((len(starts), len(starts)))
    for place in places:
        here = ~np.isnan(place[:, 0])
        apart = np.hypot(*(place[:, None] - place).transpose(2, 0, 1))
        total += np.where(here[:, None] & here, apart, FETCH_DISTANCE * (here[:, None] != here))
    return total


def _nearest_next(between: Array) -> Index:
    left = np.ones(len(between), dtype=bool)
    order = [0]
    for _ in range(len(between) - 1):
        left[order[-1]] = False
        order.append(int(np.where(left, between[order[-1]], np.inf).argmin()))
    return np.array(order)


def _shorten(order: Index, between: Array) -> bool:
    """Turn parts of the order round, in place, where that is shorter; whether it was somewhere."""
    shorter = False
    for k in range(len(order) - 2):
        here, then, later = order[k], order[k + 1], order[k + 2 :]
        after = np.append(later[1:], later[-1])
        last = np.arange(len(later)) == len(later) - 1
        old = between[here, then] + np.where(last, 0.0, between[later, after])
        new = between[here, later] + np.where(last, 0.0, between[then, after])
        best = int((new - old).argmin())
        if new[best] < old[best] - LEAST_GAIN:
            order[k + 1 : k + 3 + best] = order[k + 1 : k + 3 + best][::-1].copy()
            shorter = True
    return shorter
