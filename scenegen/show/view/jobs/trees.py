"""The formulas of a spec as trees for the page: what repeats is folded into one line, and every line knows the nodes of
the core that it stands for, so that values of a scene can be shown beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from scenegen.api.outline import FormulaTree, Outline, OutlinePart
from scenegen.api.spec import Spec
from scenegen.errors import Diagnostic, RequestError, Span
from scenegen.errors.program import MOTION_TOO_LONG, TOO_MANY_SHOWN
from scenegen.lang.formula.core import REQUIRE, Atom, BoundedUntil, Core, Everywhere, Junction, Moment, Window
from scenegen.lang.formula.timed import Numpy, Signal, Timed, TimedValues, over_time
from scenegen.search import node_bounds
from scenegen.show.view.limits import MAX_MOMENTS, MAX_MOTION, MAX_SCENES

MOST = 300  # lines of one label
MOST_NODES = 400  # nodes of one line whose values are looked at

Json = dict[str, Any]


class Trees:
    """`trees` maps each label, and `require`, to its tree; `shown` are the nodes whose values the page wants."""

    def __init__(self, outline: Outline) -> None:
        self.core: Core = outline.core
        self.trees: dict[str, Json] = {}
        self.groups: list[tuple[int, ...]] = []  # by the number of a line: the nodes that it stands for
        self.least: list[bool] = []  # whether the smallest of their values counts, or the largest
        folded = FormulaTree(outline)
        for label in outline.labels:
            self.trees[label] = self._tree(folded, folded.root(label))

    def _tree(self, folded: FormulaTree, root: OutlinePart) -> Json:
        made = self._line(root, True)
        waiting = [(root, made)]
        count = 1
        while waiting:
            part, line = waiting.pop(0)
            least = self._kind(part) != "one"
            for child in folded.children(part):
                count += 1
                if count > MOST:
                    line["more"] = line.get("more", 0) + 1
                    continue
                below = self._line(child, least)
                line["parts"].append(below)
                waiting.append((child, below))
        return made

    def _kind(self, part: OutlinePart) -> str:
        node = self.core.nodes[part.nodes[0]]
        return ("all" if node.kind == "min" else "one") if isinstance(node, Junction) else "atom"

    def _line(self, part: OutlinePart, least: bool) -> Json:
        number = len(self.groups)
        self.groups.append(part.nodes[:MOST_NODES])
        self.least.append(least)
        line = part.line
        return {
            "line": number,
            "kind": self._kind(part),
            "text": line.text,
            "margin": line.margin,
            "unit": line.unit,
            "count": part.count,
            "bounds": [line.low, line.high],
            "spans": spans(self.core, part.nodes[0]),
            "parts": [],
        }

    def values(self, values: Sequence[float]) -> list[float]:
        """The value of every line in one scene, given the value of every node."""
        return [
            (min if least else max)(values[node] for node in nodes)
            for nodes, least in zip(self.groups, self.least, strict=True)
        ]


def spans(core: Core, index: int) -> list[list[int]]:
    """Where in the main text an atom stands: its use first, then outwards. Empty where it stands in another file."""
    node = core.nodes[index]
    if not isinstance(node, Atom) or not node.spans:
        return []
    return [[one.start, one.end] for one in own(node.spans)]


def own(found: Sequence[Span]) -> list[Span]:
    """Those places that lie in the text itself: the outermost use always does, unless the label was imported."""
    main = found[-1].source
    return [one for one in found if one.source is main]


# --------------------------------------------------------------------------------------------------------------------
# The formulas of a spec over time as trees for the page: what time makes of formulas, and below that the formulas of
# a single moment, folded as those of scenes are.
#
# A line of such a tree has a value at every moment. For the whole motion it counts at one of them: below `always`
# where its formula is least, below `eventually` where it is largest, and so on down from moment 0, so that the value
# of a line comes from that of a line below it.


Array = npt.NDArray[np.float64]


class _States(Outline):
    """The outline of the formulas of a single moment, over the box (3N,) of poses."""

    def __init__(self, timed: Timed, lowest: Array, highest: Array) -> None:
        if timed.steps:  # every object as it stands now, and as it stood before
            lowest, highest = np.tile(lowest, 2), np.tile(highest, 2)
        self._core = timed.state
        self._bounds = node_bounds(timed.state, lowest, highest)
        self._choices = {}  # what moves stands on one surface
        self.labels = tuple(timed.state.labels)


@dataclass(frozen=True, slots=True)
class LineNodes:
    """What a line stands for: a node over time, or nodes of the state core of which the least or the largest counts."""

    node: int | None
    states: tuple[int, ...] = ()
    least: bool = True


class TimedTrees:
    """`trees` maps each label, and `require`, to its tree; the lines are numbered through all of them."""

    def __init__(self, timed: Timed, lowest: Array, highest: Array) -> None:
        self.timed = timed
        self._states = _States(timed, lowest, highest)
        self._folded = FormulaTree(self._states)
        self._low, self._high = self._bounds()
        self.places: list[LineNodes] = []
        self._below: list[list[int]] = []  # by the number of a line: those of the lines below it
        self.roots: dict[str, int] = {}
        self.trees: dict[str, Json] = {}
        labels = {**timed.labels, **({} if timed.requirement is None else {REQUIRE: timed.requirement})}
        for label, node in labels.items():
            self.roots[label] = len(self.places)
            self.trees[label] = self._tree(node)

    def _bounds(self) -> tuple[list[Array], list[Array]]:
        """What every node over time can be at least and at most, at every moment."""
        found = self._states._bounds
        ends = [[float(getattr(found[node], end)) for node in self.timed.state.labels.values()] for end in ("lo", "hi")]

        def everywhere(value: float) -> Array:
            return np.full(self.timed.horizon.moments, value)

        low, high = (over_time(Numpy(), self.timed, [everywhere(x) for x in end], everywhere) for end in ends)
        return low, high

    def _tree(self, root: int) -> Json:
        made, below = self._line(root, True)
        waiting, count = [(made, below)], 1
        while waiting:
            line, parts = waiting.pop(0)
            least = line["kind"] != "one"
            for part in parts:
                count += 1
                if count > MOST:
                    line["more"] = line.get("more", 0) + 1
                    continue
                one, further = self._line(part, least)
                line["parts"].append(one)
                self._below[line["line"]].append(one["line"])
                waiting.append((one, further))
        return made

    def _line(self, part: int | OutlinePart, least: bool) -> tuple[Json, list[int | OutlinePart]]:
        """The line of a node over time, or of a part of a moment's formula; and what lies below it."""
        place = part
        while isinstance(part, int):
            node = self.timed.nodes[part]
            match node:
                case Moment("steps", arg):  # nothing but the moments at which there is a step
                    part = arg
                    continue
                case Signal(number):
                    part = self._folded.root(str(number))
                case Junction(kind, args):
                    return self._over_time(part, "all" if kind == "min" else "one", node.text), list(args)
                case BoundedUntil(_, left, right):
                    return self._over_time(part, "time", node.text), [left, right]
                case Window(_, arg) | Moment(_, arg):
                    return self._over_time(part, "time", node.text), [arg]
                case Everywhere(holds):
                    return self._over_time(part, "atom", "true" if holds else "false"), []
        line = part.line
        core = self.timed.state
        junction = core.nodes[part.nodes[0]]
        word = ("all" if junction.kind == "min" else "one") if isinstance(junction, Junction) else "atom"
        number = self._take(LineNodes(place if isinstance(place, int) else None, part.nodes[:MOST_NODES], least))
        found = {
            "line": number, "kind": word, "text": line.text, "margin": line.margin, "unit": line.unit,
            "count": part.count, "bounds": [line.low, line.high], "spans": spans(core, part.nodes[0]), "parts": [],
        }  # fmt: skip
        return found, list(self._folded.children(part))

    def _over_time(self, node: int, kind: str, text: str) -> Json:
        number = self._take(LineNodes(node))
        words = {"all": "all of", "one": "one of"}.get(kind, text)
        if kind in ("all", "one") and text and text != REQUIRE:
            words = f"{words}: {text}"
        ends = [float(self._low[node][0]), float(self._high[node][0])]
        return {
            "line": number, "kind": kind, "text": words, "margin": "", "unit": "", "count": "", "bounds": ends,
            "spans": [], "parts": [],
        }  # fmt: skip

    def _take(self, place: LineNodes) -> int:
        self.places.append(place)
        self._below.append([])
        return len(self.places) - 1

    def values(self, scored: TimedValues) -> Array:
        """The value of every line at every moment, (lines, T + 1); infinite where there is none."""
        found = np.empty((len(self.places), self.timed.horizon.moments))
        for number, place in enumerate(self.places):
            if place.node is not None:
                found[number] = scored.values[place.node]
            else:
                some = np.stack([scored.states[node] for node in place.states])
                found[number] = some.min(axis=0) if place.least else some.max(axis=0)
        return found

    def moments(self, scored: TimedValues, values: Array) -> list[int]:
        """The moment at which every line counts for the whole motion."""
        found = [0] * len(self.places)
        for label, root in self.roots.items():
            found[root] = int(np.argmin(values[root])) if label == REQUIRE else 0
            waiting = [root]
            while waiting:
                number = waiting.pop()
                below = self._below[number]
                for one, moment in zip(below, self._moments(number, found[number], scored), strict=False):
                    found[one] = moment
                waiting += below
        return found

    def _moments(self, number: int, t: int, scored: TimedValues) -> list[int]:
        """Of a line that counts at moment t: the moments at which the lines below it do."""
        place, last = self.places[number], self.timed.horizon.steps
        node = None if place.node is None or place.states else self.timed.nodes[place.node]
        match node:
            case Window(kind, arg, lowest, highest):
                some = scored.values[arg][t + lowest : t + highest + 1]
                if not some.size:
                    return [min(t + lowest, last)]
                return [t + lowest + int(some.argmin() if kind == "min" else some.argmax())]
            case Moment("first", _):
                return [0]
            case Moment("last", _):
                return [last]
            case BoundedUntil():
                return self._until(node, t, scored)
            case _:
                return [t] * len(self._below[number])

    def _until(self, node: BoundedUntil, t: int, scored: TimedValues) -> list[int]:
        sign = 1.0 if node.kind == "max" else -1.0
        left, right = (sign * scored.values[part][t : t + node.highest + 1] for part in (node.left, node.right))
        held = np.minimum.accumulate(left)
        if not node.closed:
            held = np.concatenate([[np.inf], held[:-1]])
        both = np.minimum(held, right)[node.lowest :]
        if not both.size:
            return [t, min(t + node.lowest, self.timed.horizon.steps)]
        end = node.lowest + int(both.argmax())
        before = left[: end + 1] if node.closed else left[:end]
        return [t + (int(before.argmin()) if before.size else 0), t + end]


# --------------------------------------------------------------------------------------------------------------------
# What the page needs to know of a spec over time: its formulas, and how many of its motions can be shown.


def timed_of(spec: Spec) -> Timed:
    """What a spec over time means."""
    assert spec.over_time is not None
    return spec.over_time


def most_of(spec: Spec) -> int:
    """How many motions of a spec the page shows; 0 where a single one is too long."""
    size = timed_of(spec).horizon.moments * max(1, len(spec.objects))
    return 0 if size > MAX_MOTION else min(MAX_SCENES, MAX_MOMENTS // size)


def too_long(spec: Spec) -> Diagnostic:
    """What is said of motions that the page does not show."""
    return MOTION_TOO_LONG(poses=timed_of(spec).horizon.moments * len(spec.objects), most=MAX_MOTION)


def check_size(spec: Spec, count: int) -> None:
    """Raises RequestError for more motions than the page shows."""
    most = most_of(spec)
    if most == 0:
        raise RequestError(too_long(spec))
    if not 1 <= count <= most:
        raise RequestError(TOO_MANY_SHOWN(most=most, count=count, what="motions"))


@lru_cache(maxsize=2)
def trees_of(spec: Spec) -> TimedTrees:
    """The formulas of a spec over time."""
    return TimedTrees(timed_of(spec), *spec.declared.box())
