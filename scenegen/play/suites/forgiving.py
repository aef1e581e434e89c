"""Starts that people can set by hand: on a grid, and such that errors of placing them change nothing.

A start forgives errors up to so many metres along x and along y and so many radians, of all objects at once, if phi
stays in its band and what its task requires keeps holding whatever they are. Interval bounds over the box of all such
poses prove it: they never err. Where they are too wide the box is cut in two, until all parts are proved, or one has a
scene in it that breaks out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from scenegen.api.sample import draw_scenes
from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import SceneSet, evaluate
from scenegen.api.spec import Spec
from scenegen.arrays import Array, Bool
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_TIME_TO_CHECK, OUT_OF_RANGE
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import REQUIRE, Core, gate, read_rows
from scenegen.lang.formula.interpret import phi as score
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import ANGLES, LENGTHS, THETA, as_poses, is_angle, row_count, rows_along, span_of, wrap_heading
from scenegen.sampling.request import SampleRequest
from scenegen.search.contract import Bounds, label_bounds
from scenegen.search.effort import Budget
from scenegen.search.tape import make_batches

TRIED_ERRORS = 64  # of each start, at corners of the box, before bounds are computed
MAX_PROOF_BOXES = 4096  # of one start; one that takes more is left out
MOST_METRES = 10.0
ADVICE_STARTS, LEAST_OF_BAND = 2048, 0.005  # drawn to find what would do, and which share of them a band has at least
ADVICE_EDGES, PROVED_STARTS = 48, 12  # places where bands may end, and how many of a band's starts are tried to prove
EPS_ERROR = 1e-9  # metres and radians
TOLERANCE_SHARES = (0.8, 0.65, 0.5, 0.4, 0.3, 0.2, 0.1)  # tolerances that are tried, in that which was asked for
RADIAN_LENGTH = 0.1  # metres: what a radian counts when the widest side of a box is looked for


@dataclass(frozen=True, slots=True)
class Placing:
    """How starts are set: `errors` in metres and radians that they forgive, `grid` in metres between lines that objects
    stand on, multiples from the origin, `headings` in radians that headings are multiples of; 0 for none."""

    errors: tuple[float, float] = (0.0, 0.0)
    grid: float = 0.0
    headings: float = 0.0

    def __post_init__(self) -> None:
        for name, value, most in (
            ("tolerance", self.errors[0], MOST_METRES),
            ("tolerance", self.errors[1], math.pi),
            ("grid", self.grid, MOST_METRES),
            ("headings", self.headings, math.pi),
        ):
            if not 0.0 <= value <= most:
                raise RequestError(OUT_OF_RANGE(argument=name, value=f"{value:g}", wanted=f"from 0 to {most:g}"))

    def __str__(self) -> str:
        said = [f"errors up to {self.errors[0]:g} m and {self.errors[1]:g} rad"] if any(self.errors) else []
        said += [f"on a grid of {self.grid:g} m"] if self.grid else []
        return ", ".join(said + ([f"headings each {self.headings:g} rad"] if self.headings else []))

    @property
    def argument(self) -> str:
        """The argument that most likely asks too much."""
        return "tolerance" if any(self.errors) else "grid" if self.grid else "headings"

    def keep(self, spec: Spec, scenes: SceneSet, wanted: Mapping[str, Bounds], budget: Budget) -> SceneSet:
        """Those of the scenes, moved onto the grid, that are still in the ranges that are wanted of labels, and hold
        what the spec requires, whatever the errors. Raises RequestError where time is up."""
        checked = spec.checked
        core, rows = gate(checked.core), rows_of(checked, self._onto_grid(checked, scenes))
        ends = {**wanted, REQUIRE: (0.0, np.inf)}
        kept = checked.workspace.contains(rows) & _meet(core, rows, ends)
        reach = self._reach(checked)
        if reach.any():
            kept[kept] = _prove(core, rows[:, kept], reach, ends, checked.box(), budget)
        poses = as_poses(rows[: scenes.poses[0].size, kept])
        bare = SceneSet(poses, {}, scenes.header, on=None if scenes.on is None else scenes.on[kept], trusted=True)
        return replace(bare, phi=evaluate(checked, bare), trusted=True)

    def advise(self, spec: Spec, label: str, ranges: Sequence[Bounds], edges: bool, seed: int, budget: Budget) -> str:
        """What to type where ranges of phi of a label have too few such starts: as many bands as there can be, with
        `edges` where they may end, and a tolerance with which the ranges do. Each is proved on some of the starts that
        are drawn for it; "" where nothing was found, or time is up."""
        said = []
        with suppress(RequestError):
            request = SampleRequest({}, ADVICE_STARTS, seed=seed, spread="base", timeout=budget.seconds_left, workers=1)
            scenes = draw_scenes(spec, request)
            reached = self._phi_within_errors(spec.checked, scenes, label)
            ends = min(low for low, _ in ranges), max(high for _, high in ranges)
            for count in range(len(ranges), 0, -1) if edges else ():
                bands = _widest_bands(reached, ends, count)
                if bands and self._have_starts(spec, scenes, label, reached, bands, budget):
                    each = enumerate(reversed(bands), 1)
                    said.append(" ".join(_as_option("bands", f"level{k}={low:g}:{high:g}") for k, (low, high) in each))
                    break
            for share in TOLERANCE_SHARES if any(self.errors) else ():
                metres, radians = (share * error + EPS_ERROR for error in self.errors)
                cm, degrees = math.floor(1e3 * metres) / 10.0, math.floor(math.degrees(radians))
                placing = replace(self, errors=(cm / 100.0, math.radians(degrees)))
                reached = placing._phi_within_errors(spec.checked, scenes, label)
                if placing._have_starts(spec, scenes, label, reached, ranges, budget):
                    said.append(_as_option("tolerance", f"{cm:g}cm,{degrees}deg"))
                    break
        return " or ".join(said)

    def _phi_within_errors(self, spec: CheckedSpec, scenes: SceneSet, label: str) -> tuple[Array, Array]:
        """(B,) each: about the lowest and highest phi of a label within the errors; NaN where something breaks."""
        core, rows, reach = gate(spec.core), rows_of(spec, self._onto_grid(spec, scenes)), self._reach(spec)
        low, high = np.full(rows.shape[1], np.inf), np.full(rows.shape[1], -np.inf)
        good, rng = _inside(rows, reach, spec.box()), np.random.default_rng(0)
        for _ in range(TRIED_ERRORS):
            phi = score(core, list(_wrap(rows + reach[:, None] * rng.choice((-1.0, 1.0), rows.shape))), NUMPY)
            good &= phi[REQUIRE] >= 0.0
            low, high = np.minimum(low, phi[label]), np.maximum(high, phi[label])
        return np.where(good, low, np.nan), np.where(good, high, np.nan)

    def _have_starts(
        self,
        spec: Spec,
        scenes: SceneSet,
        label: str,
        reached: tuple[Array, Array],
        ranges: Sequence[Bounds],
        budget: Budget,
    ) -> bool:
        """Whether each range has enough of the scenes, and one of those that are farthest inside is proved."""
        for low, high in ranges:
            slack = np.minimum(reached[0] - low, high - reached[1])
            inside = np.flatnonzero(slack >= 0.0)
            some = inside[np.argsort(-slack[inside])][:PROVED_STARTS]
            if len(inside) < LEAST_OF_BAND * len(scenes) or not len(
                self.keep(spec, scenes[some], {label: (low, high)}, budget)
            ):
                return False
        return True

    def _onto_grid(self, spec: CheckedSpec, scenes: SceneSet) -> SceneSet:
        free = [which for which in range(len(spec.objects)) if which not in spec.fixed]
        poses = scenes.poses.copy()
        for axes, step in ((LENGTHS, self.grid), (ANGLES, self.headings)):
            for axis in axes if step else ():
                poses[:, free, axis] = np.round(np.round(poses[:, free, axis] / step) * step, 9)
        poses[..., THETA] = wrap_heading(np, poses[..., THETA])
        return SceneSet(poses, {}, scenes.header, on=scenes.on, trusted=True)

    def _reach(self, spec: CheckedSpec) -> Array:
        """(3M,): how far each coordinate of the core may be off; what is held, and switches, are not."""
        lowest, _ = spec.box()
        reach = np.zeros(len(lowest))
        for row in range(row_count(len(spec.objects))):
            reach[row] = self.errors[is_angle(row)]
        for which in spec.fixed:
            reach[span_of(which)] = 0.0
        return reach


EXACT_PLACING = Placing()


def join_scenes(parts: Sequence[SceneSet]) -> SceneSet:
    """Scenes of one spec as one set, each once."""
    poses = np.concatenate([one.poses for one in parts])
    on = [one.on for one in parts if one.on is not None]
    _, first = np.unique(poses.reshape(len(poses), math.prod(poses.shape[1:])), axis=0, return_index=True)
    which = np.sort(first)
    phi = {label: np.concatenate([one.phi[label] for one in parts])[which] for label in parts[0].phi}
    return SceneSet(poses[which], phi, parts[0].header, on=np.concatenate(on)[which] if on else None, trusted=True)


def _meet(core: Core, rows: Array, wanted: Mapping[str, Bounds]) -> Bool:
    """(B,): which scenes, (3M, B), have phi of labels where it is wanted."""
    phi = score(core, list(rows), NUMPY)
    good = np.ones(rows.shape[1], dtype=bool)
    for label, (low, high) in wanted.items():
        good &= (phi[label] >= low) & (phi[label] <= high)
    return good


def _prove(
    core: Core, rows: Array, reach: Array, wanted: Mapping[str, Bounds], box: tuple[Array, Array], budget: Budget
) -> Bool:
    """(B,): of which scenes all others within reach have phi of labels where it is wanted, and are in the workspace."""
    good = _inside(rows, reach, box)
    rng = np.random.default_rng(0)  # which corners are tried changes only how long a proof takes
    for _ in range(TRIED_ERRORS):
        some = np.flatnonzero(good)
        there = rows[:, some] + reach[:, None] * rng.choice((-1.0, 1.0), (len(rows), len(some)))
        good[some] = _meet(core, _wrap(there), wanted)
    for which in np.flatnonzero(good):
        if budget.is_spent:
            raise RequestError(NO_TIME_TO_CHECK())
        good[which] = _prove_one(core, rows[:, which], reach, wanted)
    return good


def _inside(rows: Array, reach: Array, box: tuple[Array, Array]) -> Bool:
    """(B,): of which scenes all others within reach are in the workspace."""
    lengths = [row for row in range(len(reach)) if reach[row] and not is_angle(row)]
    inside = (rows - reach[:, None] >= box[0][:, None]) & (rows + reach[:, None] <= box[1][:, None])
    return np.asarray(inside[lengths].all(axis=0))


def _as_option(name: str, value: str) -> str:
    """An option as it is typed: `suite new` makes suites, and people run it."""
    return f"--{name} {value}"


def _widest_bands(reached: tuple[Array, Array], ends: Bounds, count: int) -> list[Bounds]:
    """So many bands side by side from end to end, of which the one with the fewest scenes, whose lowest and highest phi
    are `reached`, has most (dynamic programming over edges); none where one would be empty."""
    low, high = (one[~np.isnan(one)] for one in reached)
    if not len(low):
        return []
    inner = np.quantile(np.concatenate([low, high]), np.linspace(0.0, 1.0, ADVICE_EDGES)[1:-1])
    edges = [ends[0], *sorted({float(f"{one:.3g}") for one in inner.tolist() if ends[0] < one < ends[1]}), ends[1]]
    has = np.array([[((low >= a) & (high <= b)).sum() for b in edges] for a in edges])
    best, ways = has[0], [[0]] * len(edges)
    for _ in range(count - 1):
        least = np.minimum(best[:, None], has)
        before = least.argmax(axis=0).tolist()
        best, ways = least.max(axis=0), [[*ways[one], one] for one in before]
    way = [edges[one] for one in ways[-1]] + [ends[1]]
    return list(pairwise(way)) if best[-1] else []


def _prove_one(core: Core, scene: Array, reach: Array, wanted: Mapping[str, Bounds]) -> bool:
    """The same of one scene (3M,)."""
    labels = list(core.labels)
    low, high = (np.array([[wanted.get(one, (-np.inf, np.inf))[end]] for one in labels]) for end in (0, 1))
    batches, cut = make_batches(core.nodes), sorted(read_rows(core) & set(np.flatnonzero(reach).tolist()))
    scale = np.array([RADIAN_LENGTH if is_angle(row) else 1.0 for row in cut])[:, None]
    lowest, highest = (scene - reach)[:, None], (scene + reach)[:, None]
    count = 1
    while lowest.shape[1]:
        with np.errstate(all="ignore"):
            least, most = label_bounds(core, lowest, highest, batches=batches)
        proved = ((least >= low) & (most <= high)).all(axis=0)
        lowest, highest = lowest[:, ~proved], highest[:, ~proved]
        count += 2 * lowest.shape[1]
        if count > MAX_PROOF_BOXES or not _meet(core, _wrap((lowest + highest) / 2.0), wanted).all():
            return False
        widest = np.array(cut)[((highest - lowest)[cut] * scale).argmax(axis=0)]
        columns = np.arange(lowest.shape[1])
        middle = (lowest + highest)[widest, columns] / 2.0
        left, right = highest.copy(), lowest.copy()
        left[widest, columns] = right[widest, columns] = middle
        lowest, highest = np.concatenate([lowest, right], axis=1), np.concatenate([left, highest], axis=1)
    return True


def _wrap(rows: Array) -> Array:
    rows = rows.copy()
    rows[rows_along(THETA)] = wrap_heading(np, rows[rows_along(THETA)])
    return rows
