"""Random moves that leave phi where it is: they bring scenes nearer to the truth, whatever the network made of them.

A move shifts one coordinate of a scene or some of its objects together, turns an object about another or mirrors it
there, or exchanges two. It keeps volumes and is as likely as its opposite; it is undone where phi leaves its place,
something required is broken or a centre leaves the workspace. The uniform distribution over the scenes with the wanted
phi does not change under such moves (Metropolis et al., "Equation of state calculations by fast computing machines",
1953), and any other comes nearer to it with every one. There are as many as are cheap: each costs an evaluation of the
formula.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from scenegen.lang.core import REQUIRE, Apply, gated
from scenegen.lang.spec import CheckedSpec
from scenegen.models.layout import depends_on
from scenegen.pose import PLACE, SIZE, THETA, TWO_PI, X, Y, along, axis_of, owner, row_of
from scenegen.robustness import Robustness

MOVES = 24  # of a scene, at most
WORK = 2500  # visits of nodes that they may take for each scene
PER_SHAPE = 30  # what a footprint costs, in plain nodes
SHORTEST, LONGEST = 0.01, 0.5  # of the workspace, or of a turn
FITTED, AIM = 0.75, 0.3  # of the shifts of one coordinate are fitted, so that this share of them is kept
START, LEAST, AROUND = 0.05, 1e-5, 3.0  # of the range: fitted steps at first, and the least; factor from step to step
SURE = 16  # scenes: how far fewer than that fit a step

Array = npt.NDArray[np.float64]
Move = tuple[Tensor, Tensor]


class Stir:
    """Of one spec; `tolerance` (L, 1) or (L, B) is how far phi may be from where it is wanted, `box` (3N,) each where
    poses may lie, if not all over the spec's. `count` moves are made, if there is anything `moving`."""

    def __init__(self, spec: CheckedSpec, tolerance: Tensor, box: tuple[Array, Array] | None = None) -> None:
        core = gated(spec.core)
        self._phi = Robustness(core)
        self._required = REQUIRE in core.labels
        self._tolerance = tolerance
        low, high = (torch.from_numpy(ends).to(torch.float32)[:, None] for ends in box or spec.box())
        self._low, self._high, self._size = low[:, 0], high[:, 0], (high - low)[:, 0]
        self._turns = torch.zeros(len(low), dtype=torch.bool)
        self._turns[along(THETA)] = True
        self._rows = torch.tensor([row for row in depends_on(spec.core) if float(self._size[row]) > 0.0])
        where = [owner(row) for row in self._rows.tolist() if axis_of(row) in PLACE]
        # objects whose place matters; the number of a switch is moved by itself alone
        self._free = torch.tensor([one for one in sorted(set(where)) if one < len(spec.objects)], dtype=torch.int64)
        self._objects = len(spec.objects)
        self._moves = [self._one, self._around, self._one, self._some, self._one, self._swap]
        if len(self._free) < 2:
            self._moves = [self._one]
        shapes = sum(len(node.shapes) for node in core.nodes if isinstance(node, Apply))
        count = min(MOVES, WORK // (len(core.nodes) + PER_SHAPE * shapes))
        self.moving = len(self._rows) > 0
        self.count = count if self.moving else 0

    def __call__(
        self,
        rows: Tensor,
        wanted: Tensor,
        generator: torch.Generator,
        right: Tensor | None = None,
        tolerance: Tensor | None = None,
    ) -> Tensor:
        """Moved scenes (3N, B); wanted phi (L, B), NaN where a label is free. Scenes that are not where they ought to
        be stay as they are; `right` (B,) says which are, where that is known; `tolerance` (L, B) instead of the
        usual."""
        off = self._tolerance if tolerance is None else tolerance
        ends = wanted - off, wanted + off
        return self.within(rows, ends, generator, self.count, right)

    def within(
        self,
        rows: Tensor,
        ends: tuple[Tensor, Tensor],
        generator: torch.Generator,
        moves: int,
        right: Tensor | None = None,
        *,
        fit: bool = False,
    ) -> Tensor:
        """Moved scenes (3N, B) whose phi is to stay within `ends`, (L, B) each, after so many moves; where an end is
        NaN, the label is free. With `fit` the steps of each coordinate become about as long as there is room for: what
        is held to a millimetre hardly moves by others."""
        rows = rows.clone()
        right = self._inside(rows, *ends) if right is None else right
        reach = torch.full((len(rows),), START) if fit else None
        for number in range(moves):
            move = self._moves[number % len(self._moves)]
            place, new = move(rows, generator, reach)
            inside = ((new >= self._low[place]) & (new <= self._high[place])).all(dim=0)
            old = rows.gather(0, place)
            rows.scatter_(0, place, new)
            keep = right & inside & self._inside(rows, *ends)
            rows.scatter_(0, place, torch.where(keep, new, old))
            if reach is not None and move == self._one:
                tried, kept = (torch.bincount(place[0][some], minlength=len(rows)) for some in (right, right & keep))
                reach = (reach * torch.exp((kept - AIM * tried) / (tried + SURE))).clamp_(LEAST, LONGEST)
        return rows

    def _right(self, rows: Tensor, wanted: Tensor) -> Tensor:
        """Which scenes have the wanted phi, and meet what is required, (B,)."""
        return self._inside(rows, wanted - self._tolerance, wanted + self._tolerance)

    def _inside(self, rows: Tensor, low: Tensor, high: Tensor) -> Tensor:
        values = self._phi.rows(rows, check=False)
        labels = values[: len(low)]
        right = ~((labels < low) | (labels > high)).any(dim=0)
        return right & (values[-1] >= 0.0) if self._required else right

    # A move names rows of each scene, (K, B), and their new values, (K, B).

    def _one(self, rows: Tensor, generator: torch.Generator, reach: Tensor | None) -> Move:
        """One coordinate, shifted by a random amount; mostly by about its `reach` (3N,), a share of its range."""
        random = torch.rand(3 if reach is None else 4, rows.shape[1], generator=generator)
        place = _pick(self._rows, random[:1])
        step = _step(random[1], random[2])
        if reach is not None:
            fitted = reach[place[0]] * AROUND ** (2.0 * random[1] - 1.0) * step.sign()
            step = torch.where(random[3] < FITTED, fitted, step)
        new = rows.gather(0, place) + step * self._size[place]
        return place, torch.where(self._turns[place], torch.remainder(new, TWO_PI), new)

    def _some(self, rows: Tensor, generator: torch.Generator, _: Tensor | None) -> Move:
        """Some of the objects, shifted together along x or y."""
        random = torch.rand(3 + len(self._free), rows.shape[1], generator=generator)
        step = torch.where(random[3:] < 0.5, _step(random[0], random[1]), torch.zeros(()))
        axis = torch.where(random[2] < 0.5, X, Y)
        place = SIZE * self._free[:, None] + axis
        return place, rows.gather(0, place) + self._size[place] * step

    def _around(self, rows: Tensor, generator: torch.Generator, _: Tensor | None) -> Move:
        """One object, turned about another by a random angle, or mirrored there at x, y or a diagonal."""
        random = torch.rand(4, rows.shape[1], generator=generator)
        place = _place(_pick(self._free, random[0]))
        centre = rows.gather(0, _place(_pick(torch.arange(self._objects), random[1])))
        offset = rows.gather(0, place) - centre
        mirror = random[2] < 0.5
        angle = torch.where(mirror, (random[3] * 4.0).floor() * (0.5 * math.pi), random[3] * TWO_PI)
        cosine, sine = torch.cos(angle), torch.sin(angle)
        across = torch.where(mirror, -offset[1], offset[1])  # a mirror image turned is one at another axis
        turned = torch.stack([cosine * offset[0] - sine * across, sine * offset[0] + cosine * across])
        return place, centre + turned

    def _swap(self, rows: Tensor, generator: torch.Generator, _: Tensor | None) -> Move:
        """Two objects, in each other's places."""
        random = torch.rand(2, rows.shape[1], generator=generator)
        here, there = (_place(_pick(self._free, number)) for number in random)
        return torch.cat([here, there]), torch.cat([rows.gather(0, there), rows.gather(0, here)])


def _pick(options: Tensor, random: Tensor) -> Tensor:
    """One of the options (K,) for each number (B,) in [0, 1)."""
    return options[(random * len(options)).long().clamp_max(len(options) - 1)]


def _place(thing: Tensor) -> Tensor:
    """The rows of x and y of objects (B,), (2, B)."""
    return torch.stack([row_of(0, axis) + SIZE * thing for axis in PLACE])


def _step(size: Tensor, sign: Tensor) -> Tensor:
    """Steps (B,) of either sign, from numbers in [0, 1)."""
    return SHORTEST * (LONGEST / SHORTEST) ** size * torch.where(sign < 0.5, -1.0, 1.0)
