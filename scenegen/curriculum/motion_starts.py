"""Where episodes over time start: at the first moments of motions whose phi lies in the wanted range.

So from every start there is a motion of that phi. Motions are drawn in blocks, which all environments of a process
share; each takes a block's motions in an order of its own.
"""

from __future__ import annotations

import hashlib
import math
from collections import OrderedDict
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.motions import MotionSet, read_motions, sample_motions
from scenegen.api.spec import Spec
from scenegen.curriculum.errors import as_gymnasium, refused
from scenegen.curriculum.request import PhiRanges
from scenegen.curriculum.tasks import PhiBox
from scenegen.errors import RequestError
from scenegen.errors.learning import MOTIONS_OF_ANOTHER_SPEC, NO_MOTION_IN_FILE
from scenegen.errors.requests import MISSING_ARGUMENT, WRONG_VALUE
from scenegen.motions.scores import TraceScores

Array = npt.NDArray[np.float64]

BLOCK = 256  # motions drawn at once: the plan costs most of it
SECONDS = 60.0  # for a block
KEPT = 64  # blocks in memory

REQUESTS = 256  # whose order a stream remembers

Block = tuple[Array, Array]
"""First moments (B, N, 3) and phi of their motions (B, L)."""

_BLOCKS: OrderedDict[tuple[bytes, PhiRanges, int], Block] = OrderedDict()


@dataclass(frozen=True, slots=True, eq=False)
class MotionStarts:
    """First moments (N, 3) for a spec over time: drawn, or of `given` motions."""

    spec: Spec
    given: MotionSet | None = None
    phi: Array = field(init=False)  # (n, L) of the given motions
    _key: bytes = field(init=False)

    def __post_init__(self) -> None:
        what = repr(self.spec.over_time).encode()  # its meaning: texts that import others may be alike
        box = b"".join(end.tobytes() for end in self.spec.declared.box())
        object.__setattr__(self, "_key", hashlib.blake2b(what + box).digest())
        object.__setattr__(self, "phi", np.empty((0, len(self.spec.labels))))
        if self.given is not None:
            object.__setattr__(self, "phi", self._scored(self.given))

    @property
    def space(self) -> PhiBox:
        """The phi of the given motions, from the lowest to the highest of each label. Raises gymnasium.error.Error
        where none are given: what can be drawn takes long to find out."""
        if self.given is None:
            question = "a curriculum takes its starts from motions: draw some with `scenegen sample`"
            raise refused(MISSING_ARGUMENT(argument="source", question=question))
        good = self.phi[~np.isnan(self.phi).any(axis=1)]
        if not len(good):
            raise refused(NO_MOTION_IN_FILE(wanted="any phi"))
        return PhiBox(tuple(good.min(axis=0).tolist()), tuple(good.max(axis=0).tolist()))

    def block(self, ranges: PhiRanges, number: int, nearest: bool = False) -> Block:
        """Block `number` of starts in the ranges, at least one; given motions are one block, repeated. With `nearest`
        the given motions nearest to the ranges, where none is in them. Raises gymnasium.error.InvalidBound where there
        is no motion in them."""
        if self.given is not None:
            above, below = np.array(ranges.low) - self.phi, self.phi - np.array(ranges.high)
            away = np.maximum(np.maximum(above, below), 0.0).sum(axis=1)
            least = np.nanmin(away, initial=np.inf) if nearest else 0.0
            inside = away <= least
            if not inside.any():
                wanted = ranges.describe(self.spec.labels)
                raise refused(NO_MOTION_IN_FILE(wanted=wanted), error.InvalidBound)
            return np.asarray(self.given.poses[inside, 0]), np.asarray(self.phi[inside])
        key = (self._key, ranges, number)
        if key not in _BLOCKS:
            _BLOCKS[key] = self._drawn(ranges, number)
            if len(_BLOCKS) > KEPT:
                _BLOCKS.popitem(last=False)
        _BLOCKS.move_to_end(key)
        return _BLOCKS[key]

    def _drawn(self, ranges: PhiRanges, number: int) -> Block:
        seed = int.from_bytes(hashlib.blake2b(repr((ranges, number)).encode(), digest_size=4).digest()) >> 1
        phi = {name: (one.low, one.high) for name, one in ranges.phi(self.spec.labels).items()}
        closed = all(None not in ends for ends in phi.values())
        try:
            found = sample_motions(
                self.spec, phi, BLOCK, seed=seed, spread="flat" if phi and closed else "base", timeout=SECONDS,
                keep_partial=True, workers=1,
            )  # fmt: skip
        except RequestError as problem:
            raise refused(problem.diagnostics[0], error.InvalidBound) from problem
        return np.asarray(found.poses[:, 0]), np.stack([found.phi[name] for name in self.spec.labels], axis=1)

    def _scored(self, given: MotionSet) -> Array:
        timed = self.spec.over_time
        assert timed is not None
        moments = timed.horizon.moments
        if given.objects != self.spec.objects or given.poses.shape[1] != moments:
            facts = {"found": given.objects, "steps": given.poses.shape[1] - 1, "wanted": self.spec.objects}
            raise refused(MOTIONS_OF_ANOTHER_SPEC(**facts, horizon=moments - 1))
        with np.errstate(all="ignore"):
            scores = TraceScores(timed)(np.ascontiguousarray(given.poses.transpose(2, 3, 1, 0)))
        phi = scores[:-1].T.copy()
        phi[scores[-1] < 0.0] = math.nan  # never in a range: the spec's requirement does not hold
        return np.asarray(phi)


def open_motions(spec: Spec, source: MotionSet | str | Path | None) -> MotionStarts:
    """Raises gymnasium.error.Error for anything else than motions of the spec, or their file."""
    if source is None or isinstance(source, MotionSet):
        return MotionStarts(spec, source)
    if not isinstance(source, str | Path):
        wanted = "motions, or the path of their file"
        raise refused(WRONG_VALUE(argument="source", value=f"of type {type(source).__name__}", wanted=wanted))
    with as_gymnasium():
        return MotionStarts(spec, read_motions(source))


class MotionStream:
    """Starts in the order of one environment."""

    def __init__(self, starts: MotionStarts, rng: np.random.Generator) -> None:
        self._starts, self._rng = starts, rng
        self._left: OrderedDict[PhiRanges, tuple[int, list[int]]] = OrderedDict()

    def take(self, ranges: PhiRanges, *, nearest: bool = False) -> tuple[Array, Array]:
        """The next start (N, 3), and phi of its motion (L,). Raises gymnasium.error.InvalidBound."""
        number, left = self._left.get(ranges, (-1, []))
        number += not left
        poses, phi = self._starts.block(ranges, number, nearest)
        left = left or self._rng.permutation(len(poses)).tolist()
        place = left.pop()
        self._left[ranges] = number, left
        self._left.move_to_end(ranges)
        if len(self._left) > REQUESTS:
            self._left.popitem(last=False)
        return np.array(poses[place]), phi[place]
