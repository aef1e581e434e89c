"""Exact scenes, spread over phi: what models learn from.

The scenes come from the exact samplers, and which of them are kept depends on their phi alone: so among the scenes of
any phi they are distributed as the truth is, and none is a copy of another moved a little. They are drawn in batches,
each of which holds a range of phi as it occurs. Of each label half lie evenly over all that phi can be, from hopeless
to solved; a quarter just below 0; the others satisfy it, as they occur, and once more where few of these are. So the
satisfied and the nearly satisfied are a good share, however small a part of the range they have: of experiment 2's
[-2.94, 0.1] a thirtieth, and what everyone asks for. Of several labels some scenes satisfy all.
"""

from __future__ import annotations

import math
from collections.abc import Sized
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import count as numbers_from

import numpy as np
import torch
from torch import Tensor

from scenegen.errors import RequestError
from scenegen.errors.learning import NOTHING_TO_LEARN, RARE_SCENES, TOO_RARE_TO_TRAIN
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.codec import EVERY
from scenegen.learn.training.config import GATHERING
from scenegen.learn.training.dataset import Dataset, label_scenes
from scenegen.learn.training.gathering import Gathering, SceneBatch, TimeUpError
from scenegen.processes.pool import run_pieces
from scenegen.sampling.choice import choose
from scenegen.sampling.engine.blocks import Drawing
from scenegen.sampling.prior import pull_back
from scenegen.sampling.problem import make_problem
from scenegen.sampling.rarity import Rarity, measure
from scenegen.sampling.request import MAX_SEED, Range, SampleRequest
from scenegen.search.effort import NEVER, Stop, StoppedError

ASKED = 0.6  # of the scenes lie where `phi` says
WHOLE, BELOW = 0.5, 0.25  # of a label's scenes: evenly over all of phi, and just below 0; the others satisfy it
TAIL, BEYOND = 0.4, 0.2  # of the scenes of a range: the share that lies where only that share of them occurs
TOGETHER_SHARE = 0.15  # of the scenes, at least, satisfy all labels, where there are several
WIDE_RANGE_SHARE = 0.25  # of a label's range: where so much is satisfied, scenes that lie evenly have enough of it
CELLS, RUNGS = 32, 8  # of a label's range, and batches towards each of its ends
FIRST_BATCH_SHARE = (
    0.4  # of the time of a range that is filled evenly, for its first batch, and of what is left for each further
)
FULL_CELL_SHARE = 0.8  # of its share, below which a cell counts as short of scenes
MAX_JOINT_CELLS = 4096  # joint cells at most: 16 a label for two or three labels, 8 for four, 4 for six, 2 for twelve
PER_LABEL = 16  # cells of one label at most
MAX_JOINT_LABELS = 12  # labels that are balanced jointly; further ones by themselves alone
JOINT_SHARE, MANY_SHARE = 0.5, 0.25  # of the scenes of two, and of more labels, are balanced jointly, the others by one
POOL = 3  # scenes drawn for each that is kept by joint balancing
EDGE_MARGIN = 1e-3  # of the range: its very ends have no volume
MIN_BATCH_SCENES = 1_000  # scenes of a batch, however rare
BATCH_SECONDS = 70.0  # that batches may take together, as estimated; the clock (Gathering) has the last word
VISIT = {"rejection": 1.2e-9, "growth": 8e-9}  # seconds a visit of a node takes, with all that goes with it (measured)
OTHER_VISIT = 6e-9
MIN_SCENE_SHARE = 0.5  # of the scenes that were asked for


def draw_balanced(
    spec: CheckedSpec,
    scenes: int,
    generator: torch.Generator,
    gathering: Gathering | None = None,
    phi: dict[str, Range] | None = None,
) -> Dataset:
    """`scenes` exact scenes, spread over phi of each label by itself, and as far as possible of all labels together
    (the first twelve, where there are more); with `phi`, most of them in these ranges.

    What is required holds in all scenes. Raises RequestError where a label cannot vary, a range cannot be, or too
    little is in reach.
    """
    seed = int(torch.randint(2**62, (), generator=generator))
    gathering = gathering or Gathering()
    gathering.begin("measuring the range of phi")
    whole = reach(spec, seed, gathering, gathering.until)
    labels = list(whole)
    asked = round(ASKED * scenes) if phi else 0
    rest = scenes - asked
    share = round(_joint_share(whole) * rest)
    wanted = rest - share + POOL * share
    gathering.begin(GATHERING, asked + wanted)
    both = len(whole) > 1 and all(high > 0.0 for _, high in whole.values())
    draws = _Draws(spec, seed, gathering, asked + wanted + (round(TOGETHER_SHARE * rest) if both else 0))
    found: list[tuple[Tensor, int]] = []
    if phi:
        draws.begin(asked)
        place = labels.index(next(iter(phi))) if len(phi) == 1 else EVERY
        found.append((draws.draw_tempered(phi, asked), place))
        if not found[0][0].shape[1]:
            raise RequestError(TOO_RARE_TO_TRAIN(found=0, wanted=asked))
    spread: list[tuple[Tensor, int]] = []
    for place, (label, ends) in enumerate(whole.items()):
        number = wanted * (place + 1) // len(whole) - wanted * place // len(whole)
        spread += [(rows, place) for rows in draws.draw_spread(label, ends, number)]
    rows, origin = _shuffle_parts(spread, generator)
    count = rows.shape[1]
    if count < MIN_SCENE_SHARE * min(wanted, MIN_BATCH_SCENES):
        raise RequestError(TOO_RARE_TO_TRAIN(found=count, wanted=wanted))
    data = label_scenes(spec, rows)
    if len(whole) > 1:
        kept, joint = _jointly(data.phi, list(whole.values()), min(rest, round(rest * count / wanted)), generator)
        origin = torch.where(joint, torch.full_like(kept, EVERY), origin[kept])
        data = data.take(kept)
        lacking = round((TOGETHER_SHARE - data.positives) * len(data))
        if lacking > 0 and both:
            draws.begin(draws.planned)
            found.append((draws.draw_batch(dict.fromkeys(labels, Range(0.0, None)), lacking), EVERY))
            least = len(data) - found[-1][0].shape[1]  # so many of the others stay
            data, origin = data.take(slice(0, least)), origin[:least]
    if found:
        others = [(data.rows[:, origin == place], place) for place in torch.unique(origin).tolist()]
        rows, origin = _shuffle_parts([*found, *others], generator)
        data = label_scenes(spec, rows)
    return replace(data, regions=tuple(draws.regions), balanced=origin if len(whole) > 1 else None)


def _shuffle_parts(parts: list[tuple[Tensor, int]], generator: torch.Generator) -> tuple[Tensor, Tensor]:
    """The scenes of several parts in random order, (3N, M), and the place of each one's part, (M,)."""
    rows = torch.cat([rows for rows, _ in parts], dim=1)
    place = torch.cat([torch.full((rows.shape[1],), place) for rows, place in parts])
    order = torch.randperm(rows.shape[1], generator=generator)
    return rows[:, order].contiguous(), place[order]


@dataclass(slots=True)
class _Draws:
    """Batches of exact scenes, for one part of the set after another; `planned` scenes are planned for parts that have
    not begun, for which time is `kept`: seconds as estimated, and of the clock. Of every batch `regions` has the range
    and the phi of its scenes: how phi is distributed there."""

    spec: CheckedSpec
    seed: int
    gathering: Gathering
    planned: int
    regions: list[tuple[dict[str, Range], Tensor]] = field(default_factory=list)
    done: int = 0
    part: int = 0
    drawn: int = 0
    number: int = 0
    seconds: float = field(default_factory=lambda: BATCH_SECONDS)
    kept: tuple[float, float] = (0.0, 0.0)

    def begin(self, count: int) -> None:
        """A part of `count` scenes begins: whatever it costs, later ones have their share of the time."""
        self.planned, self.done, self.part, self.drawn = self.planned - count, self.done + self.part, count, 0
        later = self.planned / max(1, self.planned + count)
        self.kept = later * self.seconds, later * self.gathering.seconds_left

    def draw_spread(self, label: str, ends: tuple[float, float], count: int) -> list[Tensor]:
        """About `count` scenes of one label, spread as the module's text says."""
        low, high = ends
        if not low < 0.0 < high or high >= WIDE_RANGE_SHARE * (high - low):
            self.begin(count)
            return [self.draw_evenly(label, ends, count)]
        evenly, below = round(WHOLE * count), round(BELOW * count)
        self.begin(evenly)
        whole = self.draw_evenly(label, ends, evenly)
        self.begin(count - evenly - below)
        solved = self.draw_tempered({label: Range(0.0, None)}, count - evenly - below)
        width = float(self.phi(label, solved).max()) if solved.shape[1] else high
        self.begin(below)
        near = self.draw_batch({label: Range(max(low, -width), 0.0)}, below)
        return [whole, solved, near]

    def draw_tempered(self, ranges: dict[str, Range], count: int) -> Tensor:
        """Scenes of a range as they occur, and, of one label, once more on the side where few of them lie far apart."""
        tail = round(TAIL * count) if len(ranges) == 1 else 0
        found = self.draw_batch(ranges, count - tail, 1.0 - TAIL if tail else 1.0)
        if not tail or not found.shape[1]:
            return found
        [(label, ends)] = ranges.items()
        values = self.phi(label, found)
        least, middle, most = float(values.min()), float(values.median()), float(values.max())
        few = torch.quantile(values[:100_000], torch.tensor([BEYOND, 1.0 - BEYOND])).tolist()
        side = Range(few[1], ends.high) if middle - least <= most - middle else Range(ends.low, few[0])
        if not (side.low is None or side.low < most) or not (side.high is None or side.high > least):
            return found
        return torch.cat([found, self.draw_batch({label: side}, tail)], dim=1)

    def draw_evenly(self, label: str, ends: tuple[float, float], count: int) -> Tensor:
        """`count` scenes with phi as evenly over a range as batches of all scenes and of those beyond a value give."""
        low, high = ends
        found = [self.draw_batch({}, count, FIRST_BATCH_SHARE)]
        edges = np.linspace(low, high, CELLS + 1)
        cells = torch.from_numpy(edges[1:-1]).to(torch.float32)
        place = [torch.bucketize(self.phi(label, found[0]), cells)]
        middle = int(place[0].median()) if len(place[0]) else CELLS // 2
        for upwards in (True, False):
            inner = middle
            for _ in range(RUNGS):
                filled = torch.bincount(torch.cat(place), minlength=CELLS)
                way = range(inner + 1, CELLS) if upwards else range(inner - 1, -1, -1)
                short = [cell for cell in way if filled[cell] < FULL_CELL_SHARE * count / CELLS]
                if not short:
                    break
                inner = short[0]
                side = Range(float(edges[inner]), None) if upwards else Range(None, float(edges[inner + 1]))
                more = max(2, round(1.5 * count * len(short) / CELLS))
                found.append(self.draw_batch({label: side}, more, FIRST_BATCH_SHARE))
                place.append(torch.bucketize(self.phi(label, found[-1]), cells))
                if found[-1].shape[1] < more:
                    break
        return torch.cat(found, dim=1)[:, _evenly(torch.cat(place), count)]

    def phi(self, label: str, rows: Tensor) -> Tensor:
        """phi (m,) of scenes (3N, m)."""
        return label_scenes(self.spec, rows).phi[self.spec.labels.index(label)]

    def draw_batch(self, ranges: dict[str, Range], count: int, share: float = 1.0) -> Tensor:
        """`count` scenes of these ranges as they occur, (3N, m) float32; fewer, which is said, where they take more
        than a share of the time that is left for this part."""
        gathering, self.number = self.gathering, self.number + 1
        gathering.allow(share, self.kept[1])
        seed = (self.seed + self.number - 1) % MAX_SEED
        made = gathering.batch(f"{self.number} {_text(ranges)} {count}", len(self.spec.box()[0]))
        try:
            if not made.whole and count:
                self._fill(made, ranges, count, seed, share)
        except TimeUpError:
            raise
        except RequestError:
            # of a range that people asked for the reason matters
            if self.number == 1:
                raise
        rows = torch.from_numpy(made.rows).to(torch.float32)
        self.seconds -= made.seconds
        if rows.shape[1] < count and (rows.shape[1] or len(ranges) < 2):
            what = f"phi of {_text(ranges)}" if ranges else "what the spec requires"
            gathering.note(RARE_SCENES(what=what, fewer=rows.shape[1], count=count))
        self.drawn += count
        self.tell()
        if rows.shape[1]:
            self.regions.append((ranges, label_scenes(self.spec, rows).phi))
        return rows

    def tell(self, more: int = 0) -> None:
        """So many more of a batch are there."""
        self.gathering.reach(self.done + min(self.part, self.drawn + more))

    def _fill(self, made: SceneBatch, ranges: dict[str, Range], count: int, seed: int, share: float) -> None:
        """Draw the pieces of a batch that are not there yet. Raises RequestError where there is no plan."""
        gathering = self.gathering
        budget = gathering.budget()
        problem = make_problem(self.spec, SampleRequest(ranges, count, seed, spread="base", workers=1), budget)
        with closing(choose(problem, budget)) as plan:
            visits = plan.evaluations * problem.cost / count
            each = max(1e-12, visits * VISIT.get(plan.method, OTHER_VISIT))
            seconds = share * max(0.0, self.seconds - self.kept[0])
            count = min(count, max(MIN_BATCH_SCENES, int(seconds / each)))
            made.seconds = count * each
            with closing(run_pieces(Drawing(plan, len(self.spec.labels)), numbers_from(made.pieces))) as pieces:
                while made.rows.shape[1] < count:
                    try:
                        block = next(pieces)
                    except StoppedError:
                        break
                    plan.check(block.rows, block.phi)
                    gathering.add(made, block.rows[:, : count - made.rows.shape[1]])
                    self.tell(made.rows.shape[1])
                    if gathering.overdrawn:
                        break
        made.whole = True


def _text(ranges: dict[str, Range]) -> str:
    return " ".join(f"{label}={one}" for label, one in ranges.items())


def _evenly(cell: Tensor, count: int) -> Tensor:
    """`count` of the scenes with these cells (M,), in random order, such that the cells are filled as evenly as scenes
    allow: the first of every cell, then the second of every cell, and so on. Returns indices."""
    _, index, counts = torch.unique(cell, return_inverse=True, return_counts=True)
    order = torch.argsort(index, stable=True)
    within = torch.empty_like(order)
    within[order] = torch.arange(len(order)) - torch.repeat_interleave(counts.cumsum(0) - counts, counts)
    return torch.argsort(within, stable=True)[:count]


def _jointly(
    phi: Tensor, ends: list[tuple[float, float]], scenes: int, generator: torch.Generator
) -> tuple[Tensor, Tensor]:
    """Which of the scenes with phi (L, M), in random order, to keep: some as they come, and of all others so many from
    each cell of the labels' product that the cells are filled as evenly as scenes allow. Returns indices (scenes,) in
    random order, and which of them are of the second kind."""
    share = round(_joint_share(ends) * scenes)
    plain = scenes - share  # chosen first: what thinning leaves over lacks the rare cells
    rest = phi[:, plain:]
    together = min(len(ends), MAX_JOINT_LABELS)
    per = min(PER_LABEL, int(MAX_JOINT_CELLS ** (1.0 / together) + 1e-9))
    cell = torch.zeros(rest.shape[1], dtype=torch.int64)
    for values, (low, high) in zip(rest[:together], ends[:together], strict=True):
        cell = cell * per + ((values - low) / (high - low) * per).long().clamp(0, per - 1)
    thinned = plain + _evenly(cell, share)
    kept = torch.cat([torch.arange(plain), thinned])
    mixed = torch.randperm(len(kept), generator=generator)
    return kept[mixed], mixed >= plain


def _joint_share(labels: Sized) -> float:
    return 0.0 if len(labels) == 1 else JOINT_SHARE if len(labels) == 2 else MANY_SHARE


def reach(
    spec: CheckedSpec, seed: int, stop: Stop = NEVER, deadline: float = math.inf
) -> dict[str, tuple[float, float]]:
    """The range of phi of each label that scenes were found to have; `stop` must raise after the `deadline`, by the
    monotonic clock. Raises RequestError, and what `stop` raises."""
    found = _measure_rarity(spec, seed, stop, deadline)
    ends = {}
    for label, one in found.reaches.items():
        low, high = one.down.end, one.up.end
        if not low < high:
            raise RequestError(NOTHING_TO_LEARN(label=label, value=low))
        margin = EDGE_MARGIN * (high - low)
        top = high - margin
        if top <= 0.0 < high:  # phi of `restsOn` ends at a millimetre: scenes that satisfy it stay in reach
            top = high * (1.0 - EDGE_MARGIN)
        ends[label] = (low + margin, top)
    return ends


def _measure_rarity(spec: CheckedSpec, seed: int, stop: Stop, deadline: float) -> Rarity:
    """By chains, or by growth where these do not change surfaces, or find no scene that meets what is required."""
    lowest, highest = spec.box()
    spec, _ = pull_back(spec, lowest, highest)
    if not spec.choices:
        found = measure(spec.core, lowest, highest, spec.labels, seed, stop=stop)
        stop.check()  # what a run has found by then depends on the clock
        if isinstance(found, Rarity):
            return found
    from scenegen.sampling.growth.rarity import measure_by_growth

    try:
        vast = measure_by_growth(spec, spec.labels, seed, deadline=deadline)
        stop.check()
        return vast
    except (StoppedError, RequestError):  # time may be up
        stop.check()
        raise
