"""What bounds and planning may take: until someone says stop, and at most so much work, which is counted.

A unit of work is about what bounding a sum over one box takes; calls of numpy and of Python are counted in the same
units. Counts do not depend on the machine: what gives up for having counted too much does so everywhere.

What is counted of one kind takes another time than what is counted of another. Where methods are compared, counts
become seconds of CPU by the constants below, which `python benchmarks/units.py` measures. They are those of one
machine, so that the same request gets the same method on all.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Protocol, cast

from scenegen.geometry.footprint import Circle, PlacedBox, Stack
from scenegen.geometry.quantile import QUANTILE, Quantile
from scenegen.lang.formula.core import Apply, Node, children

BOUND_SECONDS = 8.6e-9  # seconds of a unit of bounds and planning
# of one of scoring candidates, of calls, and of drawing a coordinate
SCORE_SECONDS, CALL_SECONDS, DRAW_SECONDS = 4.2e-9, 2e-8, 1.2e-8
# of a step of growth over all its scenes, and of a unit of scoring one of them
GROWTH_STEP_SECONDS, GROWTH_SCORE_SECONDS = 4e-4, 1.7e-9
MOVE_SECONDS = 6.3e-9  # of a unit of scoring a scene that a chain moves to
# units of proposing it, and of the calls of a move of all chains, besides those of scoring
MOVE_WORK, MOVE_CALLS_WORK = 12.0, 1e4
CALL_WORK = 1000  # of an interval rule, for each of its arguments, however few boxes there are
# quantiles: bounds, for each run in a call, and for each option and box; values, for each run, argument and scene
QUANTILE_CALL_WORK, QUANTILE_WORK, QUANTILE_SCORE_WORK = 12_000, 16, 8
CORNERED_WORK = 10  # times as much as a sum: what a footprint with corners takes
# of a scene: the share of a body that is seen, for each upright piece of all bodies; a clearance to a shadow, and times
# as much as other clearances for each argument, where footprints have corners
SHARE_WORK, SHADOW_WORK, SHADOW_TIMES = 1000.0, 40.0, 10.0
SHADOW, SEEN = "shadowGap", ("shadowGap", "visibleShare")
PYTHON_WORK = 200  # a few lines of Python for one node, set or tuple


class StoppedError(Exception):
    """Time was up before there was a result. `how_far` says in words what there was by then; "" if nothing is known. It
    travels with the error, so it reaches the user from a worker process, too."""

    def __init__(self, how_far: str = "") -> None:
        super().__init__(how_far)
        self.how_far = how_far


class Stop(Protocol):
    """Tells work that takes long, whenever it checks, that time is up."""

    def check(self) -> None:
        """Raises StoppedError where time is up."""


@dataclass(frozen=True, slots=True)
class Never:
    """Time is never up."""

    def check(self) -> None:
        pass


NEVER = Never()


GRACE_SECONDS = 0.25  # after which work that should finish is stopped, too


@dataclass(frozen=True, slots=True)
class Budget:
    """When to stop searching. A time limit can only cut a run short; the scenes before the cut do not depend on it.

    When it is pickled for another process, it keeps the seconds that are left, because clocks may differ."""

    seconds: float = 60.0
    started: float = field(default_factory=time.monotonic)

    def __reduce__(self) -> tuple[type[Budget], tuple[float]]:
        return Budget, (self.ends - time.monotonic(),)

    @property
    def ends(self) -> float:
        """When time is up, by this process's monotonic clock."""
        return self.started + self.seconds

    @property
    def seconds_left(self) -> float:
        """The seconds until then; a millisecond at least, which is a time limit, too."""
        return max(self.ends - time.monotonic(), 1e-3)

    @property
    def is_spent(self) -> bool:
        return time.monotonic() - self.started >= self.seconds

    @property
    def overdrawn(self) -> bool:
        """Time has long been up: even work that should finish is stopped."""
        return time.monotonic() - self.started >= self.seconds + GRACE_SECONDS

    def check(self) -> None:
        """Raises StoppedError if time has long been up."""
        if self.overdrawn:
            raise StoppedError


class TooMuchError(Exception):
    """More work was counted than was allowed."""


@dataclass(slots=True)
class Effort:
    """Counts work. `stop` is called whenever some is added; `most` is how much is allowed. `further` is
    called once, when all of it is used: it returns how much is allowed then."""

    stop: Callable[[], bool] = lambda: False
    most: float = math.inf
    used: float = 0.0
    further: Callable[[], float] | None = None

    def spend(self, units: float) -> None:
        """Count work that is about to be done. Raises TooMuchError beyond `most`, StoppedError where `stop` says so."""
        self.used += units
        if self.used > self.most and self.further is not None:
            ask, self.further = self.further, None
            self.most = max(self.most, ask())
        if self.used > self.most:
            raise TooMuchError
        self.check()

    def allows(self, units: float) -> bool:
        """Whether so much more is within what is allowed now."""
        return self.used + units <= self.most

    def check(self) -> None:
        """Raises StoppedError where `stop` says so."""
        if self.stop():
            raise StoppedError


def effort_until_stopped(stop: Stop) -> Effort:
    """Work that raises what `stop` raises."""

    def ask() -> bool:
        stop.check()
        return False

    return Effort(ask)


def effort_until(deadline: float) -> Effort:
    """Work that is stopped after `deadline`, by the monotonic clock."""
    return Effort(lambda: time.monotonic() > deadline)


def bounding_work(node: Node, boxes: int) -> int:
    """The work of one call of a node's rule, forward or backward, for so many boxes."""
    if isinstance(node, Apply) and node.primitive == QUANTILE:
        of = cast(Quantile, node.shapes[0])
        return len(of.runs) * QUANTILE_CALL_WORK + len(of.ends) * boxes * QUANTILE_WORK
    return len(children(node)) * (CALL_WORK + boxes * (CORNERED_WORK if _has_corners(node) else 1))


def scoring_work(nodes: Iterable[Node], scenes: int) -> float:
    """The work of computing nodes of so many scenes."""
    each, calls = work_per_scene(nodes)
    return calls + scenes * each


def work_per_scene(nodes: Iterable[Node]) -> tuple[float, float]:
    """The work of computing nodes: of each scene, and of the calls, however many scenes there are."""
    plain = cornered = quantiles = 0
    seen = 0.0
    for node in nodes:
        count = len(children(node))
        plain += count
        if isinstance(node, Apply) and node.primitive == QUANTILE:
            quantiles += len(cast(Quantile, node.shapes[0]).runs) * (count - 1)
        elif isinstance(node, Apply) and node.primitive in SEEN:
            seen += _work_of_sight(node)
        else:
            cornered += count * _has_corners(node)
    return 0.1 * plain + 1.4 * cornered + QUANTILE_SCORE_WORK * quantiles + seen, plain * CALL_WORK / 8


def dear_nodes(nodes: Iterable[Node]) -> list[Node]:
    """Shares of what is seen, and clearances of hands and shadows: they take so long that it matters for how many
    scenes they are computed."""
    found: list[Node] = []
    for node in nodes:
        if isinstance(node, Apply) and (node.primitive in SEEN or PlacedBox in map(type, node.shapes[:1])):
            found.append(node)
    return found


def dear_seconds(nodes: Iterable[Node]) -> tuple[float, float]:
    """The seconds that dear nodes take, for each scene and for the calls."""
    each, calls = work_per_scene(dear_nodes(nodes))
    return SCORE_SECONDS * each, CALL_SECONDS * calls


def moving_seconds(nodes: Iterable[Node], scenes: float, moves: float) -> float:
    """The seconds of so many moves of chains, in which so many scenes are tried in all."""
    each, calls = work_per_scene(nodes)
    return MOVE_SECONDS * (scenes * (each + MOVE_WORK) + moves * MOVE_CALLS_WORK) + CALL_SECONDS * moves * calls


def _work_of_sight(node: Apply) -> float:
    if node.primitive == SHADOW:
        return SHADOW_WORK + SHADOW_TIMES * 1.4 * len(node.args) * _has_corners(node)
    return SHARE_WORK * sum(len(shape.pieces) if isinstance(shape, Stack) else 1 for shape in node.shapes)


def _has_corners(node: Node) -> bool:
    return isinstance(node, Apply) and not {*map(type, node.shapes)} <= {Circle}
