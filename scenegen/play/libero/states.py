"""Scenes -> states of an environment that have come to rest, and that its own judgement agrees with."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.api.request import Phi, read_phi
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_RANGE, WRONG_VALUE
from scenegen.play.frame import TableFrame, flat, inverse, times
from scenegen.play.libero.init_files import FIXTURE_PREFIX, read_packed, write_states
from scenegen.play.libero.measure import FLAT_SITE, ROBOT_OWNER, UPRIGHT_COSINE, LiveModel, matrix, silence
from scenegen.play.libero.sight import LiveCamera
from scenegen.play.libero.spec import PLACE_PREDICATES, EnvironmentSpec, Fact, spec_of
from scenegen.play.starts import RangeStarts, Start, phi_at
from scenegen.sampling.request import Range, Spread
from scenegen.validation import as_int, as_path, as_seconds

CONTROL_STEPS = 20  # control steps of the environment's own, after which a state is judged again
CONTACT_DEPTH = 0.003  # metres: contacts that are deeper push things away
STILL_DISTANCE = 0.01  # metres by which things may move in those steps, and initial facts be off
SHOVED_DISTANCE = 0.03  # metres by which they may move where fixtures that stand elsewhere push them
FALL_DISTANCE = 0.5  # metres: what moves farther while it settles has fallen off
TIP_COSINE = 0.985  # the cosine of 10 degrees, by which things of starts may tip
STEPS_BETWEEN_LOOKS = 50  # steps of the simulation from one look at the things to the next: 0.1 s
REST_DISTANCES = 1e-5, 1e-3  # metres: what moves less from look to look is at rest; what moves more at the end is not
MISS = -0.001  # phi of starts that miss, at most
SEEN = "visible"  # the label of the share that LIBERO's camera sees
LEAST, TRIES = 174, 10  # scenes that are drawn at most: if none of them is good, and for each state
DRAW_TIMEOUT, SIGHT_TIMEOUT = 60.0, 300.0  # seconds of a draw, and of one at a range of `visible`
UPRIGHT_DRAWS = 6  # draws without a success, after which what the goal has in a fixture is tried in other attitudes
PRESS_DEPTH = 0.0002  # metres by which solved things are lowered onto fixtures, whose tops are not quite level
LOWER_FROM = 0.0005  # metres over its floor from where a thing is lowered
BOOK_LEAN = 0.15  # radians by which it leans in the last of these attitudes, as a book does
LEAN_HEIGHT = 0.1  # metres over its floor from where it is lowered then

Judge = Callable[[], bool]


@dataclass(frozen=True, eq=False)
class SettledStates:
    """`states` (n, D) in which nothing moves: the time, qpos, qvel, as `sim.get_state().flatten()` gives them. `phi` is
    what the scenes were drawn with, `read` what the settled states have, each by label, (n,); `moved` (n,) how far
    anything moved in the environment's own 20 steps, in metres; `spec` the environment's spec. Of all `drawn` scenes
    `refused` counts those that were left out, by reason; of those that settled, in `agreed` of `judged` phi's sign was
    the environment's judgement."""

    states: Array
    phi: Mapping[str, Array]
    read: Mapping[str, Array]
    moved: Array
    spec: EnvironmentSpec
    drawn: int
    judged: int
    agreed: int
    refused: Mapping[str, int]

    def save(self, path: str | Path) -> Path:
        """Write the states as LIBERO has them (`TASK.pruned_init`), and `TASK.pruned_init.npz` with the fixtures, too;
        each file appears whole or not at all. Raises OutputError, and RequestError where torch is not installed."""
        return write_states(as_path("path", path), self.states, self.spec.live.fixed, self.spec.live.task)


@dataclass(frozen=True, slots=True, eq=False)
class _Verdict:
    """What became of a scene; `reason` is empty where its state is good."""

    reason: str
    agrees: bool | None = None  # phi's sign and the judgement, of what has settled
    state: Array | None = None
    read: Mapping[str, float] = field(default_factory=dict)
    moved: float = math.nan


def init_states(
    env: Any,
    phi: Phi | None = None,
    n: int = 50,
    *,
    settle: float = 1.0,
    accept: Judge | None = None,
    spec: EnvironmentSpec | None = None,
    seed: int = 0,
) -> SettledStates:
    """n states of an environment of LIBERO or robosuite at a range of phi, at rest, and verified by its own judgement.
    The environment has been reset, and is left as it was then.

    `phi` is a range as `scenegen.sample` takes it; without one of `goal`, starts miss it. Starts that miss are as the
    initial facts have them, unless a range of `start` is given, or one of `visible`: the share of what the goal moves
    that LIBERO's camera `agentview` sees (see `spec_of`), which a state has by what is drawn there. Things settle for
    `settle` seconds at most, while the arm is held. A state is kept if `accept`, by default the environment's
    `check_success`, agrees with the sign of phi, at once and after 20 steps of the environment's own, if nothing moves
    or touches the robot, and if the initial facts hold, to 1 cm; without those of what the goal moves where phi of
    `start` may be below 0. `spec` is what `spec_of` made of the environment since its last reset; it is made where none
    is given. It needs a label `goal`. At most ten scenes for each state are drawn, and 174 in vain: there can be fewer
    states than n. The same seed gives the same states.

    Raises RequestError, also where no scene has such a phi.
    """
    if as_int("n", n) < 1:
        raise RequestError(OUT_OF_RANGE(argument="n", value=n, wanted="1 or more"))
    own = spec_of(env, sight=isinstance(phi, Mapping) and SEEN in phi) if spec is None else spec
    if own.live.sim is not own.live.env.sim:
        wanted = "what spec_of makes of the environment after its last reset"
        raise RequestError(WRONG_VALUE(argument="spec", value="the spec of a model that is gone", wanted=wanted))
    ranges = read_phi(own.spec, {"goal": (None, MISS)} if phi is None else phi)
    if "goal" in own.spec.labels:
        ranges = {"goal": Range(None, MISS), **ranges}
    high = ranges["goal"].high if "goal" in ranges else None
    missing = high is not None and high <= 0.0
    if missing and "start" in own.spec.labels and SEEN not in ranges:
        ranges = {"start": Range(0.0), **ranges}
    judge = accept or getattr(env, "check_success", None) or env._check_success
    facts = _facts(own, ranges) if missing else ()
    maker = _Maker(env, own, lambda: bool(judge()), as_seconds("settle", settle), missing, facts, ranges.get(SEEN))
    verdicts: list[_Verdict] = []
    good: list[tuple[_Verdict, Start]] = []
    side = None
    spread: Spread = "base" if SEEN in ranges else "flat"  # flat, what is out of reach of a range costs its time
    timeout = SIGHT_TIMEOUT if SEEN in ranges else DRAW_TIMEOUT
    first = 4 * n if SEEN in ranges else n + n // 4  # each draw makes a plan, and many have another share in the camera
    starts = RangeStarts(own.spec, lambda: ranges, as_int("seed", seed), timeout, first=first, spread=spread)
    while len(good) < n and len(verdicts) < max(TRIES * n if good else 0, LEAST):
        if not missing and not good and len(verdicts) >= UPRIGHT_DRAWS:
            side = len(verdicts) - UPRIGHT_DRAWS
        try:
            start = starts.take()
        except RequestError:
            if verdicts:
                break  # there were scenes, but no more in the time
            raise
        verdicts.append(maker.judge_start(start, side))
        if not verdicts[-1].reason:
            good.append((verdicts[-1], start))
    maker.restore()
    width, settled = len(own.live.sim.get_state().flatten()), [one.agrees for one in verdicts if one.agrees is not None]
    return SettledStates(
        np.array([one.state for one, _ in good], dtype=np.float64).reshape(len(good), width),
        {label: np.array([start.phi[label] for _, start in good]) for label in own.spec.labels},
        {label: np.array([one.read[label] for one, _ in good]) for label in own.spec.labels},
        np.array([one.moved for one, _ in good]),
        own,
        len(verdicts),
        len(settled),
        sum(settled),
        Counter(one.reason for one in verdicts if one.reason),
    )


def _facts(own: EnvironmentSpec, ranges: Mapping[str, Range]) -> tuple[Fact, ...]:
    """The initial facts that starts keep: without those of what the goal moves where `start` may be below 0."""
    anywhere = "start" in own.spec.labels and ranges.get("start", Range()).ends[0] < 0.0
    return tuple(fact for fact in own.facts if not (anywhere and fact[1] in own.moved))


def set_scene(env: Any, path: str | Path, row: int) -> Any:
    """Put an environment of LIBERO's, which has been reset, into a state of a file `TASK.pruned_init.npz` exactly as it
    was made: the fixtures too, which no state has. Gives the observation, as `set_init_state` does. Raises DataError
    for a file of something else, and RequestError for one of another task, one without fixtures, and a row that is not
    there."""
    path = Path(f"{str(as_path('path', path)).removesuffix('.npz')}.npz")
    found, live = read_packed(path), LiveModel(env)
    task = str(found.pop("task", live.task))
    states, poses = found.pop("states"), {name.removeprefix(FIXTURE_PREFIX): pose for name, pose in found.items()}
    if task != live.task:
        value, wanted = f"{path}, which has states of {task}", f"a file of the environment's task, {live.task}"
        raise RequestError(WRONG_VALUE(argument="path", value=value, wanted=wanted))
    if states.shape[1:] != env.get_sim_state().shape or poses.keys() != {*live.fixtures}:
        wanted = "states with fixtures of this task, as `scenegen libero` writes them"
        raise RequestError(WRONG_VALUE(argument="path", value=str(path), wanted=wanted))
    if not 0 <= as_int("row", row) < len(states):
        raise RequestError(OUT_OF_RANGE(argument="row", value=row, wanted=f"0 to {len(states) - 1}"))
    live.stand(poses)
    return env.set_init_state(states[row])


class _Maker:
    """Puts scenes into an environment, lets them settle, and judges them."""

    def __init__(
        self,
        env: Any,
        own: EnvironmentSpec,
        judge: Judge,
        settle: float,
        missing: bool,
        facts: tuple[Fact, ...],
        seen: Range | None = None,
    ) -> None:
        self.env, self.own, self.live, self.judge, self.missing = env, own, own.live, judge, missing
        self.model, self.data = own.live.model, own.live.data
        self.seen, self.camera = seen, LiveCamera(own.live) if own.sight else None
        self.settle = round(settle / float(self.model.opt.timestep))
        self.things = [name for name in own.spec.objects if name in self.live.movers]
        joints = [one for one in range(self.model.njnt) if not self._is_ours(one)]
        self.arm = [int(self.model.jnt_qposadr[one]) for one in joints]
        self.arm_speed = [int(self.model.jnt_dofadr[one]) for one in joints]
        most = max(map(len, own.ends.values()), default=0)
        self.elsewhere = [{name: one[k % len(one)] for name, one in own.ends.items()} for k in range(most)]
        self.second = round(CONTROL_STEPS * own.live.env.control_timestep / float(self.model.opt.timestep))
        self.restore()
        self.step()
        self.facts = [one for one in facts if self.keeps(one)]  # without those that the environment's own reset breaks

    def _is_ours(self, joint: int) -> bool:
        return self.live.owners[int(self.model.jnt_bodyid[joint])] in self.live.things

    def restore(self) -> None:
        """As the environment's reset left it."""
        self.live.mj.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.live.start
        self.live.mj.mj_forward(self.model, self.data)

    def judge_start(self, start: Start, side: int | None) -> _Verdict:
        """Put a scene in, and hold it against all conditions, the cheap ones first."""
        self.put(start.poses, side)
        planned, ups, wanted = self.places(), self.ups(), start.phi.get("goal", 0.0) >= 0.0
        if wanted and not all(self.reaches(name, site) for name, site in self.own.tight.items()):
            return _Verdict("too low or too high for the site")
        if not self.come_to_rest():
            return _Verdict("does not come to rest")
        if wanted and self.elsewhere:
            for name in self.own.tight:
                self.data.qpos[self.live.movers[name] + 2] -= PRESS_DEPTH
            self.live.mj.mj_forward(self.model, self.data)
        if any(ROBOT_OWNER in (a, b) and {a, b} & {*self.things} for a, b, _ in self.live.contacts()):
            return _Verdict("touches the robot")
        if self.live.depth(self.live.movers) > CONTACT_DEPTH:
            return _Verdict("contacts deeper than 3 mm")
        tips = (self.ups() * ups).sum(axis=1).min(initial=1.0) < TIP_COSINE and self.missing
        if tips or np.abs(self.places() - planned)[:, :2].max(initial=0.0) > FALL_DISTANCE:
            return _Verdict("falls")
        state = np.asarray(self.live.sim.get_state().flatten(), dtype=np.float64)
        rested, read = self.places(), self.phi(start)
        solved = read.get("goal", 0.0) >= 0.0
        if hasattr(self.env, "set_init_state"):
            with silence():
                self.env.set_init_state(state)
        if self.judge() != solved:
            return _Verdict(f"phi is {'>= 0, but not solved' if solved else '< 0, but solved'}", False)
        low, high = self.seen.ends if self.seen else (-math.inf, math.inf)
        if self.seen and not min(low, 1.0) <= read[SEEN] <= high:
            return _Verdict("another share is visible in LIBERO's camera", True)
        if solved != wanted:
            return _Verdict(f"{'solves' if solved else 'loses'} the goal while it settles", True)
        if not self.keeps_all():
            return _Verdict("initial facts are off by more than 1 cm", True)
        self.step()
        moved = float(np.linalg.norm(self.places() - rested, axis=1).max(initial=0.0))
        if self.judge() != solved:
            return _Verdict("judged otherwise after 20 steps", False)
        if moved > STILL_DISTANCE or not self.keeps_all():
            return _Verdict("moves in 20 steps", True)
        near = self.near_fixtures()
        if not all(self.holds(state, ends, solved, near) for ends in self.elsewhere):
            return _Verdict("holds at some places of the fixtures only", True)
        return _Verdict("", True, state, read, moved)

    def holds(self, state: Array, ends: Mapping[str, Array], solved: bool, near: bool) -> bool:
        """Whether a state is judged the same where the fixtures stand at some ends of their regions, at once and after
        20 steps, and its initial facts hold. Nothing moves there if nothing touches a fixture, nor is `near` here."""
        self.live.stand(ends)
        try:
            self.live.sim.set_state_from_flattened(state)
            self.live.mj.mj_forward(self.model, self.data)
            before = self.places()
            good = self.judge() == solved and self.keeps_all()
            if good and (near or self.near_fixtures()):
                self.run(self.second)
                moved = np.linalg.norm(self.places() - before, axis=1).max(initial=0.0)
                good = self.judge() == solved and self.keeps_all() and bool(moved <= SHOVED_DISTANCE)
            return good
        finally:
            self.live.stand(self.live.fixed)

    def near_fixtures(self) -> bool:
        """Whether a thing touches a fixture."""
        pairs = ({a, b} for a, b, _ in self.live.contacts())
        return any(not pair.isdisjoint(self.own.ends) and not pair.isdisjoint(self.things) for pair in pairs)

    def put(self, poses: Array, side: int | None) -> None:
        """The things where a scene has them, each lowered until it touches something; those that stand lowest first.
        With `side`, what the goal has at a site of a fixture is turned to one of the attitudes along its axes."""
        own, live = self.own, self.live
        self.restore()
        live.put_away()
        rows = dict(zip(own.spec.objects, poses, strict=True))
        for name, part in own.sliders.items():
            self.data.qpos[part.address] = rows[name][0] / part.lever
        live.mj.mj_forward(self.model, self.data)
        for name in sorted(self.things, key=lambda name: float(rows[name][2])):
            attitude, low, over = times(rows[name][3:], own.attitudes[name]), own.prisms[name].bottom, LOWER_FROM
            if side is not None and name in own.tight:
                turn, over = _sides()[side % len(_sides())]
                live.mj.mju_mat2Quat(attitude, live.site(own.tight[name])[1].ravel())
                attitude = times(attitude, times(turn, own.attitudes[name]))
                low = float((live.points(name) @ matrix(attitude).T)[:, 2].min())
            live.place(name, rows[name][:3] + own.origin + (0.0, 0.0, over - low), attitude)
            if rows[name][2] > 0.004:
                self.lower(name)
        live.mj.mj_forward(self.model, self.data)

    def lower(self, name: str, step: float = 0.002) -> None:
        """Lower a thing until it touches, 20 cm at most, or lift it out of what it is in, 6 cm at most."""
        height = self.live.movers[name] + 2
        begun, down = float(self.data.qpos[height]), not self.touches(name)
        for _ in range(100 if down else 30):
            self.data.qpos[height] += -step if down else step
            if self.touches(name) == down:
                self.data.qpos[height] += step if down else 0.0
                return
        self.data.qpos[height] = begun

    def touches(self, name: str) -> bool:
        self.live.mj.mj_fwdPosition(self.model, self.data)
        return self.live.depth((name,)) >= 2e-4

    def reaches(self, name: str, site: str) -> bool:
        """Whether the height of a thing in a compartment is one that LIBERO takes, to 2 mm: no formula has it."""
        at, turn, size = self.live.site(site)
        half, over = float(np.abs(turn @ size)[2]), float(self.data.xpos[self.live.things[name]][2] - at[2])
        open_ = half < FLAT_SITE or np.abs(turn[2]).max() < UPRIGHT_COSINE
        return bool(open_ or -half - 0.012 <= over <= half + 0.002)

    def come_to_rest(self) -> bool:
        """Step the simulation with the arm held, until nothing moves or the time is over. True if the things rest."""
        last, moved = self.poses(), math.inf
        for left in range(self.settle, 0, -STEPS_BETWEEN_LOOKS):
            self.run(min(left, STEPS_BETWEEN_LOOKS))
            last, moved = (now := self.poses()), float(np.abs(now - last).max(initial=0.0))
            if moved < REST_DISTANCES[0]:
                break
        self.data.time, self.data.qvel[:], self.data.qacc_warmstart[:] = 0.0, 0.0, 0.0
        self.live.mj.mj_forward(self.model, self.data)
        return moved < REST_DISTANCES[1] and bool(np.isfinite(self.data.qpos).all())

    def run(self, steps: int) -> None:
        """Steps of the simulation, with the arm held."""
        arm = self.data.qpos[self.arm].copy()
        for _ in range(steps):
            self.live.mj.mj_step(self.model, self.data)
            self.data.qpos[self.arm], self.data.qvel[self.arm_speed] = arm, 0.0

    def poses(self) -> Array:
        """(N, 7): the places of the things and a tenth of their quaternions: 1 mm weighs as much as 1 degree."""
        bodies = [self.live.things[name] for name in self.things]
        return np.hstack([self.data.xpos[bodies], 0.1 * self.data.xquat[bodies]])

    def step(self) -> None:
        """20 control steps of the environment's own, without an action."""
        inner = self.live.env
        action = np.zeros(inner.action_dim)
        action[-1] = -1.0
        with silence():
            for _ in range(CONTROL_STEPS):
                inner.timestep, inner.done = 0, False
                self.env.step(action)

    def places(self) -> Array:
        """(N, 3): where the things are in the world."""
        return self.poses()[:, :3]

    def ups(self) -> Array:
        """(N, 3): which way is up, as each thing sees it."""
        found: Array = self.data.xmat[[self.live.things[name] for name in self.things], 6:]
        return found

    def phi(self, start: Start) -> dict[str, float]:
        """phi by label as the simulation is; a thing counts as being on what it is on in the scene, and a share is
        that of the simulation's camera."""
        own, found = self.own, flat(start.poses)
        for which, name in enumerate(own.spec.objects):
            if name in own.sliders:
                found[which, 0] = self.data.qpos[own.sliders[name].address] * own.sliders[name].lever
            elif name in self.live.movers:
                body = self.live.things[name]
                turn = times(self.data.xquat[body], inverse(own.attitudes[name]))
                found[which] = TableFrame(own.origin).pose(self.data.xpos[body], turn)
        read = phi_at(own.spec, start, found)
        if self.camera is not None:
            read[SEEN] = min(map(self.camera.visible_share, own.moved))
        return read

    def keeps_all(self) -> bool:
        return all(map(self.keeps, self.facts))

    def keeps(self, fact: Fact) -> bool:
        """Whether an initial fact holds: of a region of the table to 1 cm, of all else as the environment says."""
        if fact[0] in PLACE_PREDICATES and fact[1] not in self.live.movers:
            return True
        ranges = self.live.env.parsed_problem["regions"].get(fact[-1], {}).get("ranges")
        if fact[0] not in PLACE_PREDICATES or not ranges:
            return bool(self.live.env._eval_predicate(list(fact)))
        at = self.data.xpos[self.live.things[fact[1]]][:2] - self.own.origin[:2]
        corners = np.array(ranges).reshape(-1, 2, 2)
        low, high = corners.min(axis=1) - STILL_DISTANCE, corners.max(axis=1) + STILL_DISTANCE
        return bool(((at >= low) & (at <= high)).all(axis=1).any())


@cache
def _sides() -> list[tuple[Array, float]]:
    """Three times the 24 rotations by quarters of a turn; then each leaning about x or y, either way, from high."""
    cosine, sine = math.cos(BOOK_LEAN / 2.0), math.sin(BOOK_LEAN / 2.0)
    leans = [(cosine, sine, 0.0, 0.0), (cosine, 0.0, sine, 0.0), (cosine, -sine, 0.0, 0.0), (cosine, 0.0, -sine, 0.0)]
    straight = [(one, LOWER_FROM) for one in _quarters()]
    return 3 * straight + [(times(lean, one), LEAN_HEIGHT) for lean in leans for one, _ in straight]


def _quarters() -> list[Array]:
    """The 24 rotations by quarters of a turn; the first are nearest to none."""
    half = math.sqrt(0.5)
    x, y, z = ((half, *(half * axis)) for axis in np.eye(3))
    found = [np.array([1.0, 0.0, 0.0, 0.0])]
    for one in found:
        for turn in (z, x, y):
            new = times(turn, one)
            if all(abs(new @ other) < 0.99 for other in found):
                found.append(new)
    return found


def settled_scenes(env: Any, own: EnvironmentSpec, settle: float = 1.0) -> Callable[[Array], Array]:
    """A function that puts the poses (N, 7) of a scene of the environment's spec into LIBERO's environment, and gives
    the state (D,) in which the things have settled, for `settle` seconds at most, judged by nothing."""
    maker = _Maker(env, own, lambda: bool(env.check_success()), settle, True, ())

    def state(poses: Array) -> Array:
        maker.put(poses, None)
        maker.come_to_rest()
        return np.asarray(own.live.sim.get_state().flatten(), dtype=np.float64)

    return state
