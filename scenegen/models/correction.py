"""The last step of a model: its scenes are moved onto the wanted phi, and those that cannot be are drawn again.

A network of a few hundred thousand weights misses phi by millimetres to centimetres, breaks what is required now and
then, and blurs the edges between separate pieces of a level set. The spec itself knows better, and its gradient costs a
fraction of the network's evaluation. So each scene takes a few Newton steps along the gradient of phi (the shortest
that closes the gap to first order), and steps back over the limit of what is required, as far inside as it was outside:
on either side of the limit the network's blur is alike, so that scenes do not pile up on it. Scenes that are not there
after that are replaced by others for the same phi, a few times over; at first in the same branch, since some branches
are missed more often than others, and their shares are known better than that. At last some random moves that leave phi
where it is even out what the network has blurred (scenegen.models.stirring).
"""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from scenegen.lang.core import REQUIRE, gated, part
from scenegen.lang.spec import CheckedSpec
from scenegen.models.stirring import Stir
from scenegen.pose import THETA, TWO_PI, along
from scenegen.robustness import Robustness
from scenegen.robustness.slopes import Slopes

STEPS, BACK = 4, 3  # Newton steps of a scene; and of one that breaks what is required
ROUNDS, SAME = 6, 3  # times that scenes that do not arrive are drawn again, and of these in the same branch
SPARE = 4  # scenes for one that is missing, at most
MOST = 5  # scenes made for each that is wanted, on average
USEFUL = 0.02  # of the scenes of a round: with fewer that arrive there is no other round
TOLERANCE = 1e-3  # of a label's range: what counts as arrived
NEAR = 10.0  # times TOLERANCE: the same near 0, of the range from 0 to the top
LONGEST = 0.15  # of the workspace, or radians, that one coordinate may move in a step
STEP = 65_536  # scenes that are corrected at a time: there are few of each atom, and each takes calls of its own
STIRRED = 16_384  # scenes that are moved at a time: they and the values of the formula stay in cache

TURNS = along(THETA)

Make = Callable[[Tensor, torch.Generator, Tensor | None], tuple[Tensor, Tensor | None]]
"""Wanted phi (L, B), NaN where a label is free, and branches (B,) or None -> scenes (3N, B) in metres and radians, and
the branches that they were made in, where the model has any."""


class Correction:
    """Of the models of one spec. `spans` are the widths of the labels' ranges in the training data, (L,), and `tops`
    the highest phi there, 0 where phi does not change its sign: near 0 scenes arrive as exactly as a range of that
    height would have it, since a satisfied part may be a hundredth of the whole."""

    def __init__(self, spec: CheckedSpec, spans: Tensor, tops: Tensor | None = None) -> None:
        self.spec = spec
        core = gated(spec.core)
        self._labels = Slopes(spec.core)
        self._required = Robustness(part(core, [REQUIRE])) if REQUIRE in core.labels else None
        self._both = Slopes(core)
        self._most = (TOLERANCE * spans)[:, None]
        self._tops = (torch.zeros_like(spans) if tops is None else tops)[:, None]
        low, high = (torch.from_numpy(ends).to(torch.float32)[:, None] for ends in spec.box())
        self._low, self._high = low, high
        self._scale = high - low
        self._scale[TURNS] = (self._scale[TURNS] > 0.0).to(low)  # a radian; what is held does not move
        self._stir = Stir(spec, self._most)

    def __call__(self, make: Make, wanted: Tensor, generator: torch.Generator) -> Tensor:
        """Corrected scenes (3N, n) for wanted phi (L, n), NaN where a label is free."""
        first, branch = make(wanted, generator, None)
        rows, off = self._corrected(first, wanted)
        made = count = len(off)
        same = branch is not None
        for number in range(ROUNDS):
            missing = off.nonzero()[:, 0]
            rate = 1.0 - len(missing) / max(1, count)
            places = missing.repeat(max(1, min(SPARE, round(1.0 / max(rate, 0.1)))))
            made += len(places)
            if not len(missing) or made > MOST * count:
                break
            same = same and number < SAME
            again, _ = make(wanted[:, places], generator, branch[places] if branch is not None and same else None)
            fresh, failed = self._corrected(again, wanted[:, places])
            good = (~failed).nonzero()[:, 0].flip(0)  # of several for one place the first
            rows[:, places[good]] = fresh[:, good]
            off[places[good]] = False
            if len(good) < USEFUL * len(places):  # the rest is out of reach, in these branches at least
                if not same:
                    break
                same = False
        random = _on_cpu(generator)
        for start in range(0, count if self._stir.count else 0, STIRRED):
            some = slice(start, start + STIRRED)
            near = wanted[:, some], self._tolerance(wanted[:, some])
            rows[:, some] = self._stir(rows[:, some], near[0], random, ~off[some], near[1])
        return rows

    def _tolerance(self, wanted: Tensor) -> Tensor:
        """How far phi may be from where it is wanted, (L, B)."""
        near = NEAR * TOLERANCE * torch.maximum(self._tops, wanted.abs())
        return torch.where((self._tops > 0.0) & ~torch.isnan(near), torch.minimum(near, self._most), self._most)

    def _corrected(self, rows: Tensor, wanted: Tensor) -> tuple[Tensor, Tensor]:
        """Scenes (3N, B) moved, and which of them are not where they ought to be, (B,)."""
        rows, off = rows.clone(), torch.ones(rows.shape[1], dtype=torch.bool)
        for start in range(0, rows.shape[1], STEP):
            some = slice(start, start + STEP)
            rows[:, some], off[some] = self._part(rows[:, some], wanted[:, some])
        return rows, off

    def _part(self, rows: Tensor, wanted: Tensor) -> tuple[Tensor, Tensor]:
        asked = (~torch.isnan(wanted)).any(dim=1).nonzero()[:, 0].tolist()
        rows, off = self._moved(rows, wanted, asked, self._labels, STEPS)
        if self._required is None:
            return rows, off
        unmet = (~off & (self._required.rows(rows, check=False)[0] < 0.0)).nonzero()[:, 0]
        if len(unmet):
            heads = [*asked, len(wanted)]
            some, off[unmet] = self._moved(
                rows.index_select(1, unmet), wanted.index_select(1, unmet), heads, self._both, BACK
            )
            _put(rows, unmet, some)
        return rows, off

    def _moved(self, rows: Tensor, wanted: Tensor, heads: list[int], phi: Slopes, steps: int) -> tuple[Tensor, Tensor]:
        """The scenes (3N, B) after that many Newton steps at most, and which of them are still off, (B,). `heads` are
        the values of `phi` that matter; the one after the labels is the margin of what is required."""
        labels = [head for head in heads if head < len(wanted)]
        off = torch.ones(rows.shape[1], dtype=torch.bool)
        active, here, target = torch.arange(rows.shape[1]), rows, wanted[labels]
        tolerance = self._tolerance(wanted)[labels]
        rows = rows.clone()
        for step in range(steps + 1):
            values, atoms = phi(here)
            gap = torch.where(torch.isnan(target), torch.zeros(()), target - values[labels])
            far = gap.abs() > tolerance
            if len(heads) > len(labels):
                margin = values[heads[-1:]]
                gap, far = torch.cat([gap, -2.0 * margin]), torch.cat([far, margin < 0.0])
            moving = far.any(dim=0)
            off[active] = moving
            on = moving.nonzero()[:, 0]
            if step == steps or not len(on):
                _put(rows, active, here)
                break
            if step:
                there = (~moving).nonzero()[:, 0]
                _put(rows, active[there], here.index_select(1, there))
            kept = [place for place in range(len(heads)) if bool(far[place].any())]
            active, here, target, tolerance, atoms, gap, far = (
                some.index_select(-1, on) for some in (active, here, target, tolerance, atoms, gap[kept], far[kept])
            )
            slopes = [phi.gradient(here, atoms[heads[place]], far[k]) for k, place in enumerate(kept)]
            shift = newton(torch.stack(slopes) * self._scale, gap, far)
            moved = here + self._scale * shift
            here = torch.minimum(torch.maximum(moved, self._low), self._high)
            turned = torch.remainder(moved[TURNS], TWO_PI)
            here[TURNS] = torch.where(self._scale[TURNS] > 0.0, turned, here[TURNS])
        return rows, off


def _put(rows: Tensor, place: Tensor, some: Tensor) -> None:
    """Write scenes (3N, n) at places (n,) of (3N, B); four times as fast as index_copy_."""
    rows.scatter_(1, place.expand(len(rows), -1), some)


def _on_cpu(generator: torch.Generator) -> torch.Generator:
    """Random numbers for the CPU, where scenes are corrected whatever the network's device."""
    if generator.device.type == "cpu":
        return generator
    seed = torch.randint(2**62, (), generator=generator, device=generator.device)
    return torch.Generator().manual_seed(int(seed))


def newton(jacobian: Tensor, gap: Tensor, far: Tensor) -> Tensor:
    """The shortest steps (3N, B) that close the gaps (K, B) to first order where they are `far`, given the slopes
    (K, 3N, B); no coordinate further than LONGEST."""
    if len(gap) == 1:
        square = jacobian[0].square().sum(0).clamp_min(1e-12)
        step = jacobian[0] * (gap[0] * far[0] / square)
    else:
        jacobian = jacobian * far[:, None]
        gap = gap * far
        gram = torch.einsum("kdb,ldb->bkl", jacobian, jacobian)
        least = 1e-4 * gram.diagonal(dim1=1, dim2=2).amax(1).clamp_min(1e-8)
        gram = gram + torch.diag_embed((~far).T.to(gram) + least[:, None])
        weights = torch.linalg.solve(gram, gap.T[:, :, None])[:, :, 0]
        step = torch.einsum("kdb,bk->db", jacobian, weights)
    return step * (LONGEST / step.abs().amax(0).clamp_min(1e-12)).clamp_max(1.0)
