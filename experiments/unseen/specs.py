"""Random specs of the kinds that people write: distances, orders, headings, footprints, disjunctions, quantifiers.

A seed stands for a spec, once and for all: this file is the definition of the problems, so a change of it is a change
of all of them. Seeds 0 to 39 are there to tune models on, seeds 1000 to 1039 to report on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

TUNE, REPORT = range(40), range(1000, 1040)

NAMES = ("plate", "mug", "bowl", "spoon", "fork", "knife", "cup", "apple", "can", "banana")
HEADINGS = ("NORTH", "EAST", "SOUTH", "WEST", "45 deg")
REGIONS = (
    "region mat = rect(0.3, 0.1, 0.7, 0.4)",
    "region mat = rect(0.05, 0.05, 0.45, 0.55)",
    "region mat = circle((0.5, 0.5), 0.25)",
)


@dataclass(frozen=True, slots=True)
class _Draw:
    """The random choices of one spec."""

    random: np.random.Generator
    objects: tuple[str, ...]
    region: bool

    def one(self, *options: str) -> str:
        return options[int(self.random.integers(len(options)))]

    def some(self, count: int) -> list[str]:
        """Different objects."""
        return [self.objects[place] for place in self.random.permutation(len(self.objects))[:count]]

    def length(self, low: float, high: float) -> str:
        """In whole centimetres."""
        return f"{round(100 * float(self.random.uniform(low, high)))} cm"

    def likely(self, chance: float) -> bool:
        return float(self.random.random()) < chance


def spec_text(seed: int) -> str:
    """The spec of a seed: the same text on every machine."""
    random = np.random.default_rng(np.random.SeedSequence([20_261_122, seed]))
    count = int(random.choice([2, 2, 3, 3, 4, 4, 5, 6, 8, 10]))
    objects = tuple(NAMES[place] for place in sorted(random.permutation(len(NAMES))[:count]))
    draw = _Draw(random, objects, bool(random.random() < 0.35))
    lines = []
    if draw.likely(0.25):
        lines.append("workspace [0, 1.2] x [0, 0.8]")
    lines.append(f"object {', '.join(objects)}")
    if draw.region:
        lines.append(draw.one(*REGIONS))
    if draw.likely(0.45):
        lines.append("require noOverlap()")
    if draw.likely(0.15):
        lines.append("require insideWorkspace()")
    lines.append(f"task: {_formula(draw, int(random.integers(1, 4)))}")
    if draw.likely(0.35):
        lines.append(f"safe: {_formula(draw, 1)}")
    return "\n".join(lines) + "\n"


def _formula(draw: _Draw, clauses: int) -> str:
    """A conjunction of clauses, at least one of which is about all objects where there are many."""
    parts = []
    for index in range(clauses):
        if len(draw.objects) > 3 and (index == 0 or draw.likely(0.2)) and draw.likely(0.6):
            parts.append(f"({_quantified(draw)})")
        elif draw.likely(0.35):
            parts.append(f"({_disjunction(draw)})")
        else:
            parts.append(_atom(draw))
    return " & ".join(parts)


def _disjunction(draw: _Draw) -> str:
    either = [_atom(draw) if draw.likely(0.6) else f"({_atom(draw)} & {_atom(draw)})" for _ in range(2)]
    return " | ".join([*either, _atom(draw)] if draw.likely(0.25) else either)


def _quantified(draw: _Draw) -> str:
    some = draw.some(int(draw.random.integers(3, 1 + min(5, len(draw.objects)))))
    listed, other = ", ".join(some), draw.some(1)[0]
    return draw.one(
        f"forall p, q in [{listed}]: farFrom(p, q, {draw.length(0.1, 0.25)})",
        f"forall p, q in consecutive([{listed}]): {draw.one('leftOf', 'aboveOf')}(p, q)",
        f"forall p, q in consecutive([{listed}]): closeTo(p, q, {draw.length(0.15, 0.35)})",
        f"exists p in [{listed}]: closeTo(p, {draw.one('workspace.center', '(0.2, 0.2)')}, {draw.length(0.08, 0.2)})",
        f"forall p in [{listed}]: farFrom(p, {draw.one('workspace.center', 'workspace.bottomLeft')}, "
        f"{draw.length(0.15, 0.35)})",
        f"exists p, q in [{listed}]: closeTo(p, q, {draw.length(0.06, 0.15)})"
        if len(some) < len(draw.objects)
        else f"exists p in [{listed}]: angle(p, {draw.one(*HEADINGS)}, 20 deg) & nearEdge(p)",
        f"forall p in [{listed}]: angle(p, {draw.one(*HEADINGS)}, {draw.one('20', '40', '60')} deg)",
        f"forall p in [{listed}]: p_near(p, {other})".replace("p_near", draw.one("leftOf", "belowOf"))
        if other not in some
        else f"forall p, q in consecutive([{listed}]): sameHeading(p, q, 30 deg)",
    )


def _atom(draw: _Draw) -> str:
    kinds: list[Callable[[_Draw], str]] = [_distance, _distance, _order, _order, _heading, _footprint, _middle]
    return kinds[int(draw.random.integers(len(kinds)))](draw)


def _distance(draw: _Draw) -> str:
    a, b = draw.some(2)
    return draw.one(
        f"closeTo({a}, {b}, {draw.length(0.12, 0.35)})",
        f"farFrom({a}, {b}, {draw.length(0.15, 0.45)})",
        f"!closeTo({a}, {b}, {draw.length(0.12, 0.35)})",
        f"closeTo({a}, workspace.center, {draw.length(0.08, 0.3)})",
    )


def _order(draw: _Draw) -> str:
    a, b = draw.some(2)
    return f"{draw.one('leftOf', 'rightOf', 'belowOf', 'aboveOf')}({a}, {b})"


def _heading(draw: _Draw) -> str:
    a, b = draw.some(2)
    return draw.one(
        f"angle({a}, {draw.one(*HEADINGS)}, {draw.one('10', '20', '40')} deg)",
        f"sameHeading({a}, {b}, {draw.one('15', '30')} deg)",
        f"facing({a}, {b}, {draw.one('15', '30')} deg)",
    )


def _footprint(draw: _Draw) -> str:
    a, b = draw.some(2)
    options = [
        f"clearOf({a}, {b}, {draw.length(0.02, 0.12)})",
        f"fullyLeftOf({a}, {b})",
        f"fullyAboveOf({a}, {b})",
        f"nearEdge({a}, workspace, {draw.length(0.05, 0.15)})",
    ]
    if draw.region:
        options += [f"inside({a}, mat)", f"on({a}, mat)", f"!on({a}, mat)"]
    return draw.one(*options)


def _middle(draw: _Draw) -> str:
    if len(draw.objects) < 3:
        return _distance(draw)
    a, b, c = draw.some(3)
    return draw.one(
        f"between({a}, {b}, {c}, {draw.length(0.02, 0.06)})",
        f"closerThan({a}, {b}, {c})",
        f"alignedX({a}, {b}, {draw.length(0.02, 0.06)})",
        f"alignedY({a}, {c}, {draw.length(0.02, 0.06)})",
    )


TWELVE = """object plate, mug, bowl, spoon, fork
order: leftOf(mug, plate) & leftOf(plate, bowl)
near: closeTo(mug, plate, 20 cm)
apart: farFrom(plate, bowl, 30 cm)
row: alignedY(plate, bowl, 5 cm)
between: between(mug, plate, bowl, 5 cm)
north: angle(spoon, NORTH, 20 deg)
same: sameHeading(spoon, fork, 20 deg)
facing: facing(fork, plate, 30 deg)
clear: clearOf(spoon, fork, 5 cm) | leftOf(spoon, fork)
edge: nearEdge(bowl, workspace, 10 cm)
middle: closeTo(plate, workspace.center, 20 cm)
any: exists p in [mug, bowl, spoon]: closeTo(p, fork, 15 cm)
"""
