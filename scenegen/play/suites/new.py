"""A new suite: from specs to a folder of graded starts.

The starts of a task are the scenes of its spec in which the label of success does not hold and that of starts, where
the spec has one, does: both become requirements, so that the task's spec has these starts as its base distribution.
Bands are ranges of phi of the label of success. How probable they are is counted among many draws, and where these
are too few it is what `scenegen range` finds (adaptive splitting); within a band, starts are drawn from the base
distribution, so shares of the bands, weighted by their probabilities, estimate those of all starts.
"""

from __future__ import annotations

import hashlib
import io
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from scenegen.api.pairs import read_grasp
from scenegen.api.rarity import LabelRarity, rarity
from scenegen.api.sample import draw_scenes
from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec, parse, read_spec, refuse_choices
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import (
    CONFLICTING_ARGUMENTS,
    CUT_SHORT,
    NO_TIME_TO_CHECK,
    OUT_OF_PLACE,
    OUT_OF_RANGE,
    UNKNOWN_LABEL,
    WRONG_VALUE,
)
from scenegen.lang.checker import check_file
from scenegen.learn.success.files import BLANK_DIGEST
from scenegen.learn.success.statistics import Z
from scenegen.play.suites.forgiving import EXACT_PLACING, Placing, join_scenes
from scenegen.play.suites.suite import (
    NAME_PATTERN,
    SUITE_JSON,
    BandData,
    GraspData,
    SuiteFile,
    TaskData,
    goal_spec,
    overlapping,
)
from scenegen.pose import as_poses
from scenegen.sampling.engine.engines import JobResult, run_each
from scenegen.sampling.grasps import FITS, movable_things, pair_grasp
from scenegen.sampling.pairs import PairStarts, draw_pairs
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import MAX_SEED, Ends, Range, SampleRequest
from scenegen.sampling.streams import SUITES_STREAM
from scenegen.scenes.data import RequestData
from scenegen.scenes.files import refuse_existing, whole_files
from scenegen.scenes.formats.scenes_json import write
from scenegen.search.effort import Budget
from scenegen.validation import as_int, as_path, as_seconds

GOAL_LABEL, START_LABEL = "goal", "start"  # labels that are taken where none is named
BAND_DIGITS = 5  # of ends of bands and of probabilities
MAX_TASK_BANDS = 64
COUNTED_DRAWS, MIN_IN_BAND = 1 << 16, 100  # draws of a task's base distribution, and of a band at least
CURVE_POINTS = 1025  # of the curve that they give
MIN_CANDIDATES, MAX_CANDIDATES, MOST_AT_ONCE = 256, 1 << 16, 1 << 13  # starts drawn at first, in all, and at a time
HOPELESS_CANDIDATES = 1 << 13  # where none of so many is of use, no more are drawn
MOVED_THINGS = 1  # between a start and its goal in a suite with grasps
Bands = int | Mapping[str, Range]
Told = Callable[[JobResult, int, int], None]  # a task that is made, or failed; how many of how many are over


@dataclass(frozen=True, slots=True)
class TaskPlan:
    """A task whose starts are to be drawn: `source` is the text of its spec, with what starts require; `back` says that
    it is a reversed one. Ranges of phi are those of the goal: a reversed task has as many bands, equally probable."""

    name: str
    source: str
    instruction: str
    success: str
    bands: Bands
    back: bool = False

    @property
    def file(self) -> str:
        return f"{self.name}{'.reverse' if self.back else ''}.json"


def new_suite(
    specs: Sequence[tuple[str, Path]],
    out: str | Path,
    *,
    bands: Bands = 5,
    log10p: bool = False,
    n: int = 50,
    seed: int = 0,
    success: str | None = None,
    start: str | None = None,
    placing: Placing = EXACT_PLACING,
    grasp: str | Mapping[str, Ends | Range] | None = None,
    goal: Range | None = None,
    timeout: float = 600.0,
    workers: int | None = None,
    told: Told = lambda ended, done, count: None,
) -> SuiteFile:
    """Write a suite of named spec files into a folder, which names it: n starts of each band of each task.

    `bands` is their number, equally probable, or ranges by name: of phi, or with `log10p` of log10 of the share of
    starts that is at least as hard. `success` and `start` are the labels, by default `goal` (or the only one) and
    `start`. The first line of a spec's opening comment is the instruction; with a label of starts and a comment
    `# reverse: ...` there is a reversed task, too. `placing` says how starts are set by hand: on which grid, and which
    errors they forgive. `grasp`, as of `scenegen.pairs`, leaves the starts from which one thing can be moved to where
    phi of the label is in the range `goal`, by default 0 or more, with one grasp; the suite has these goals and grasps.
    `timeout` seconds are for all of them. The bytes follow from the specs and these arguments, not from `workers`.
    Raises RequestError, SpecError, DataError and OutputError.
    """
    out = as_path("out", out)
    hold = None if grasp is None else read_grasp(grasp)
    if hold is not None and placing != EXACT_PLACING:
        reason = "whether a grasp forgives errors of placing is not proved"
        raise RequestError(CONFLICTING_ARGUMENTS(one="grasp", other=placing.argument, reason=reason))
    if hold is None and goal is not None:
        rule, remedy = "is of goals to which a grasp leads", "say which robot grasps, too"
        raise RequestError(OUT_OF_PLACE(argument="goal", rule=rule, remedy=remedy))
    goal = FITS if goal is None else goal
    if goal.low is None or goal.low < 0.0:
        raise RequestError(OUT_OF_RANGE(argument="goal", value=str(goal), wanted="0 or more, where the label holds"))
    ranges: Mapping[str, Range] = bands if isinstance(bands, Mapping) else {}
    n, seed, count = as_int("n", n), as_int("seed", seed), len(ranges) or as_int("bands", bands)
    bands = ranges or count
    for name, value, low, high in (
        ("specs", len(specs), 1, 999),
        ("n", n, 1, 10_000),
        ("seed", seed, 0, MAX_SEED),
        ("bands", count, 1, MAX_TASK_BANDS),
    ):
        if not low <= value <= high:
            raise RequestError(OUT_OF_RANGE(argument=name, value=value, wanted=f"from {low} to {high}"))
    _check_names({"suite": [out.resolve().name], "task": [name for name, _ in specs], "band": ranges})
    if both := overlapping((name, *one.ends) for name, one in ranges.items()):
        rule, remedy = "overlap: starts in both would count twice", "let one end where the other begins"
        raise RequestError(OUT_OF_PLACE(option="the bands `{}` and `{}`".format(*both), rule=rule, remedy=remedy))
    plans = [one for name, path in specs for one in _tasks(name, path, success, start, bands, hold)]
    files = [SUITE_JSON, *(plan.file for plan in plans)]
    for twice in [file for file in files if files.count(file) > 1][:1]:
        rule = "would be two files of the suite: a task of this name cannot be in it"
        raise RequestError(OUT_OF_PLACE(option=twice, rule=rule, remedy="rename its spec"))
    if not log10p:
        plans = [replace(one, bands=count) if one.back else one for one in plans]
    refuse_existing(*(out / file for file in files))
    job = _MakeTask(log10p, n, seed, placing, hold, goal, Budget(as_seconds("timeout", timeout)))
    jobs = [(plan.file.removesuffix(".json"), plan) for plan in plans]
    ways: tuple[list[TaskData], list[TaskData]] = ([], [])
    with whole_files(out) as put:
        for done, (plan, ended) in enumerate(zip(plans, run_each(job, jobs, "local", workers), strict=True), 1):
            told(ended, done, len(plans))
            if ended.errors:
                raise RequestError(*ended.errors)
            task, data = ended.value
            put(task.scenes, data)
            ways[plan.back].append(task)
        manifest = SuiteFile(
            name=out.resolve().name, digest=BLANK_DIGEST, seed=seed, n=n, tasks=ways[0], reversed=ways[1],
            robot=hold[0] if hold else "",
        )  # fmt: skip
        put(SUITE_JSON, manifest.dump())
    return SuiteFile.model_validate_json(manifest.dump())


def _tasks(
    name: str, path: Path, success: str | None, start: str | None, bands: Bands, hold: tuple[str, Range] | None
) -> list[TaskPlan]:
    """The task of a spec file, and the reversed one if it has one. Raises RequestError for labels that it lacks, and
    for a robot that it lacks, or that has nothing to grasp."""
    file, data = read_spec(path)
    spec = Spec(check_file(file, data, None))
    source = spec.checked.source
    if hold is not None:
        movable_things(spec.checked, hold[0])
    for label in (success, start):
        if label is not None and label not in spec.labels:
            raise RequestError(UNKNOWN_LABEL(name=label, known=spec.labels))
    begin = start or (START_LABEL if START_LABEL in spec.labels[:-1] or START_LABEL in spec.labels[1:] else None)
    goals = [label for label in spec.labels if label != begin]
    goal = success or (GOAL_LABEL if GOAL_LABEL in goals else goals[0] if len(goals) == 1 else None)
    if goal is None:
        raise RequestError(UNKNOWN_LABEL(name=GOAL_LABEL, known=spec.labels))
    instruction = spec.checked.title or name.replace("_", " ")
    forth = f"{source}require !{goal}" + (f" & {begin}" if begin else "") + "\n"
    plans = [TaskPlan(name, forth, instruction, goal, bands)]
    said = re.search(r"^#\s*reverse:\s*(\S.*?)\s*$", data.decode(), re.MULTILINE)
    if begin is not None and said is not None:
        plans.append(TaskPlan(name, f"{source}require !{begin} & {goal}\n", said[1], begin, bands, back=True))
    return plans


def _check_names(names: Mapping[str, Iterable[str]]) -> None:
    """Raises RequestError for a name that a suite, a task or a band cannot have, given by what they are of."""
    for what, name in ((what, name) for what, some in names.items() for name in some):
        text = name.encode(errors="backslashreplace").decode()  # half of a character has a backslash then
        if re.fullmatch(NAME_PATTERN, text) is None:
            wanted = "a name of 1 to 200 characters, none of which is `/`, `\\` or a control character"
            raise RequestError(WRONG_VALUE(argument=f"name of a {what}", value=repr(name), wanted=wanted))


@dataclass(frozen=True, slots=True)
class _MakeTask:
    """The job of one task: its part of suite.json, and the bytes of its scenes file."""

    log10p: bool
    n: int
    seed: int
    placing: Placing
    grasp: tuple[str, Range] | None
    goal: Range
    budget: Budget

    def __call__(self, plan: TaskPlan) -> tuple[TaskData, bytes]:
        spec = Spec(replace(parse(plan.source, plan.name).checked, title=plan.instruction))
        curve, bounds = (
            _Curve.from_draws(spec, plan.success, self.seed, self.budget.seconds_left),
            spec.bounds()[plan.success],
        )
        if not curve.ends[0] < curve.ends[1]:
            wanted = "a label whose phi differs between starts"
            raise RequestError(WRONG_VALUE(argument="success", value=f"`{plan.success}`", wanted=wanted))
        ranges = _ranges(plan.bands, self.log10p, curve, bounds)
        if any(curve.share_between(low, high)[0] < MIN_IN_BAND / COUNTED_DRAWS for _, low, high in ranges):
            found = rarity(spec, plan.success, seed=self.seed, timeout=self.budget.seconds_left)
            if any(one.kind is CUT_SHORT for one in found.warnings):  # bands do not depend on the clock
                raise RequestError(NO_TIME_TO_CHECK())
            curve = _Curve.from_rarity(found.labels[0])
            ranges = _ranges(plan.bands, self.log10p, curve, bounds)
        bands: list[BandData] = []
        parts: list[SceneSet] = []
        for name, low, high in ranges:
            share, error = curve.share_between(low, high)
            if not share > 0.0:
                wanted = "in {:g}:{:g}, where starts are".format(*curve.ends)
                raise RequestError(OUT_OF_RANGE(argument="bands", value=f"{name}={low:g}:{high:g}", wanted=wanted))
            rng = np.random.default_rng([self.seed, SUITES_STREAM, int(spec.checked.sha256[:12], 16), len(bands)])
            part, grasps = self._draw(spec, plan, name, Range(low, high), rng, [one[1:] for one in ranges])
            rare = np.log10(curve.share(part.phi[plan.success]).clip(min=curve.least))
            bands.append(
                BandData(
                    name=name, phi=(low, high), probability=_round(share), error=round(error, 4),
                    log10p=[round(float(one), 4) + 0.0 for one in rare],
                    seeds=rng.integers(1 << 31, size=self.n).tolist(), grasps=grasps,
                )
            )  # fmt: skip
            parts.append(part)
        data = self._bytes(spec, parts, bands)
        task = TaskData(
            name=plan.name, instruction=plan.instruction, success=plan.success, scenes=plan.file,
            sha256=hashlib.sha256(data).hexdigest(), bands=bands,
        )  # fmt: skip
        return task, data

    def _draw(
        self,
        spec: Spec,
        plan: TaskPlan,
        name: str,
        band: Range,
        rng: np.random.Generator,
        ranges: Sequence[tuple[float, float]],
    ) -> tuple[SceneSet, list[GraspData]]:
        """The starts of a band, which is one of some ranges, and their grasps. Raises RequestError where too few can be
        set as they should be."""
        if self.grasp is not None:
            return self._draw_with_grasps(spec, plan, name, band, self.grasp, rng)
        chosen: list[SceneSet] = []
        n, drawn = (self.n if self.placing == EXACT_PLACING else max(MIN_CANDIDATES, self.n)), 0
        while drawn < MAX_CANDIDATES:
            request = SampleRequest(
                {plan.success: band}, n, seed=int(rng.integers(1 << 53)), spread="base",
                timeout=self.budget.seconds_left, workers=1,
            )  # fmt: skip
            part = draw_scenes(spec, request)[rng.permutation(n)]
            if self.placing == EXACT_PLACING:
                return part, []
            chosen.append(self.placing.keep(spec, part, {plan.success: band.ends}, self.budget))
            found, drawn, n = join_scenes(chosen), drawn + n, min(2 * n, MOST_AT_ONCE)
            if len(found) >= self.n:
                return found[: self.n], []
            if drawn >= HOPELESS_CANDIDATES and not len(found):
                break
        advice = self.placing.advise(spec, plan.success, ranges, not plan.back, self.seed, self.budget)
        if plan.back:
            advice = " or ".join(filter(None, ["leaving `# reverse:` out of the spec", advice]))
        few = f"{len(found)} of {drawn:,} starts of {name} of {plan.file.removesuffix('.json')} are of use"
        wanted = f"less strict, or the bands wider: {few}{advice and '; try '}{advice}"
        raise RequestError(OUT_OF_RANGE(argument=self.placing.argument, value=str(self.placing), wanted=wanted))

    def _draw_with_grasps(
        self, spec: Spec, plan: TaskPlan, name: str, band: Range, by: tuple[str, Range], rng: np.random.Generator
    ) -> tuple[SceneSet, list[GraspData]]:
        """Starts of a band with a goal that one thing has to be moved to, and the grasp. They are pairs the other way
        round: what is drawn as a goal is the start."""
        refuse_choices(spec, "a grasp")
        request = SampleRequest(
            {plan.success: band}, self.n, seed=int(rng.integers(1 << 53)), spread="base",
            timeout=self.budget.seconds_left, workers=1,
        )  # fmt: skip
        begin, after = make_problem(spec.checked, request, self.budget), goal_spec(spec).checked
        ends = make_problem(after, replace(request, phi={plan.success: self.goal}), self.budget)
        made = draw_pairs(begin, PairStarts(ends, grasp=pair_grasp(after, *by)), MOVED_THINGS, self.budget)
        assert made.grasps is not None
        if made.shortfall is not None:
            if self.budget.is_spent:
                raise RequestError(NO_TIME_TO_CHECK())
            few = f"{made.goal.shape[1]} of {self.n} starts of {name} of {plan.name} have a goal that a grasp leads to"
            wanted = f"a wider range, or the bands: {few}"
            raise RequestError(OUT_OF_RANGE(argument="grasp", value=f"{by[0]}={by[1]}", wanted=wanted))
        order = rng.permutation(self.n)
        start, goal = as_poses(made.goal)[order], as_poses(made.start)[order]
        grasps = []
        for to, (margin, *yaws) in zip(goal.tolist(), made.grasps.T[order].tolist(), strict=True):
            yaw = {name: one for name, one in zip(spec.objects, yaws, strict=True) if not math.isnan(one)}
            ends_at = {name: (x, y, turn) for name, (x, y, turn) in zip(spec.objects, to, strict=True) if name in yaw}
            grasps.append(GraspData(margin=margin, yaw=yaw, goal=ends_at))
        return spec.scenes(start), grasps

    def _bytes(self, spec: Spec, parts: Sequence[SceneSet], bands: Sequence[BandData]) -> bytes:
        phi = {label: np.concatenate([part.phi[label] for part in parts]) for label in spec.labels}
        on = [part.on for part in parts if part.on is not None]
        request = RequestData(phi={}, n=self.n * len(bands), spread="base")
        sampler = {"method": "suite", "seed": self.seed, "bands": {one.name: list(one.phi) for one in bands}}
        sampler |= {} if self.placing == EXACT_PLACING else {"placing": str(self.placing)}
        sampler |= {} if self.grasp is None else {"grasp": "{}={}".format(*self.grasp), "goal": str(self.goal)}
        header = make_header(spec.checked, sampler, request)
        poses = np.concatenate([part.poses for part in parts])
        scenes = SceneSet(poses, phi, header, on=np.concatenate(on) if on else None, trusted=True)
        sink = io.BytesIO()
        write(sink, header, tuple(phi), scenes.blocks())
        return sink.getvalue()


def _ranges(wanted: Bands, log10p: bool, curve: _Curve, bounds: tuple[float, float]) -> list[tuple[str, float, float]]:
    """Name and ends of each band, in phi. An open end is where no scene is beyond."""
    first, last = math.floor(bounds[0] * 1e4) / 1e4, min(0.0, math.ceil(bounds[1] * 1e4) / 1e4)
    if isinstance(wanted, int):
        edges = [first, *(curve.phi_at(place / wanted) for place in range(1, wanted)), last]
        return [(f"level{k + 1}", edges[-2 - k], edges[-1 - k]) for k in range(wanted)]
    found = []
    for name, one in wanted.items():
        low, high = one.low, one.high
        if log10p:
            low, high = (None if end is None or end >= 0.0 else curve.phi_at(10.0**end) for end in (low, high))
        found.append((name, first if low is None else _round(low), last if high is None else _round(high)))
    return found


@dataclass(frozen=True, slots=True)
class _Curve:
    """How phi of a label is distributed: log10 P(phi' <= phi) and P(phi' >= phi) at rising values of phi, and the
    lowest and highest phi there is. `errors` are halves of 95 % intervals of the smaller of both; of plain draws their
    number, `draws`, says how sure a share is."""

    phi: Array
    below: Array
    above: Array
    errors: Array
    ends: tuple[float, float]
    draws: int = 0

    @staticmethod
    def from_draws(spec: Spec, label: str, seed: int, timeout: float) -> _Curve:
        """By counting draws."""
        request = SampleRequest({}, COUNTED_DRAWS, seed=seed, spread="base", timeout=timeout, workers=1)
        values = np.sort(draw_scenes(spec, request).phi[label])
        phi = np.unique(values[np.linspace(0, COUNTED_DRAWS - 1, CURVE_POINTS).astype(int)])
        below = np.searchsorted(values, phi, side="right") / COUNTED_DRAWS
        above = 1.0 - np.searchsorted(values, phi, side="left") / COUNTED_DRAWS
        return _Curve(phi, np.log10(below), np.log10(above), 0.0 * phi, (float(phi[0]), float(phi[-1])), COUNTED_DRAWS)

    @staticmethod
    def from_rarity(one: LabelRarity) -> _Curve:
        """By splitting."""
        known = [(k.phi, k.below, k.above) for k in one.curve if k.below is not None and k.above is not None]
        below = np.array([low.log10 for _, low, _ in known if low is not None])
        above = np.array([high.log10 for _, _, high in known if high is not None])
        errors = np.array([min(low, high, key=lambda e: e.log10).error for _, low, high in known if low and high])
        rising = np.minimum.accumulate(np.minimum(below, 0.0)[::-1])[::-1]
        falling = np.minimum.accumulate(np.minimum(above, 0.0))
        return _Curve(np.array([phi for phi, _, _ in known]), rising, falling, errors, one.reached)

    @property
    def least(self) -> float:
        """The smallest share that is known."""
        return float(10.0 ** self.below[0])

    def share(self, phi: Array) -> Array:
        """P(phi' <= phi), from the smaller tail."""
        below, above = np.interp(phi, self.phi, self.below), np.interp(phi, self.phi, self.above)
        inner = np.where(below <= above, 10.0**below, 1.0 - 10.0**above)
        return np.where(phi <= self.ends[0], 0.0, np.where(phi >= self.ends[1], 1.0, inner))

    def share_between(self, low: float, high: float) -> tuple[float, float]:
        """P(low <= phi <= high), and half of a 95 % interval of its log10."""
        shares = self.share(np.array([low, high]))
        whole = float(shares[1] - shares[0])
        if self.draws:
            return whole, Z * math.sqrt((1.0 - whole) / max(whole * self.draws, 1.0)) / math.log(10.0)
        errors = np.minimum(shares, 1.0 - shares) * np.interp([low, high], self.phi, self.errors)
        return whole, float(np.hypot(*errors)) / whole if whole > 0.0 else 0.0

    def phi_at(self, share: float) -> float:
        """The phi that this share of the starts is at or below, rounded."""
        places = np.array([self.ends[0], *self.phi, self.ends[1]])
        return _round(float(np.interp(share, np.maximum.accumulate(self.share(places)), places)))


def _round(value: float) -> float:
    return float(f"{value:.{BAND_DIGITS}g}") + 0.0
