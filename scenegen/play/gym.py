"""Any Gymnasium environment starts its episodes from scenes of a spec. One function gives an object a pose, another one
observes; a third one may say where an object is."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, TypeAlias

import gymnasium
import numpy as np

from scenegen.api.request import Phi
from scenegen.api.scene_arrays import make_header
from scenegen.api.spec import Spec, check_spec
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import CONFLICTING_ARGUMENTS, MISSING_ARGUMENT, OUT_OF_RANGE, UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.lang.checker import check_text
from scenegen.play.frame import (
    UP_TURNS,
    Axis,
    Origins,
    TableFrame,
    flat,
    inverse,
    poses_in_world,
    quaternion_order,
    times,
)
from scenegen.play.starts import (
    STARTS_AHEAD,
    RangeStarts,
    Start,
    StartSource,
    Wanted,
    make_starts,
    phi_at,
    report_outcome,
    require_start,
)
from scenegen.play.tasks import PhiBox, is_strategy
from scenegen.sampling.streams import EPISODE_STARTS_STREAM
from scenegen.scenes.data import RequestData
from scenegen.validation import as_int, as_list, as_number, as_point, as_seconds, as_success, by_name

Put: TypeAlias = Callable[[Any, str, Array], None]
"""put(env, name, pose): the object now has the pose (7,), x, y, z in metres and a quaternion."""
Get: TypeAlias = Callable[[Any, str], Any]
"""get(env, name): the pose of the object now, in the same form; None for one that has none."""


class SceneResets(gymnasium.Wrapper[Any, Any, Any, Any]):
    """`env`, whose episodes start from scenes of `spec`.

    `phi` is a range as `scenegen.sample` takes it, a strategy of `scenegen.curriculum`, a function that gives a range
    for each episode, or a source of starts. After each reset of `env`, `put(env, name, pose)` is called with the bare
    environment for every object of the spec, those it holds in place included; the pose (7,) is x, y, z in metres and a
    quaternion, whose order is `quaternion`. `observe(env)` then gives the observation with which the episode begins.
    `origin`, `turn`, `origins` and `up` are as `scenegen.layouts.Layouts` has them.

    The same seed, at `reset`, is the same start: it chooses among the first `ahead` scenes of the range, or among those
    of the strategy's task. Episodes without a seed go on from the last one, at first from `seed`. `info["phi"]` at
    reset is phi of the start by label. With `get(env, name)`, which gives poses in the same form, `phi_now` gives it at
    any moment. `reset(options={"phi": phi})` begins one episode at another range; other options are for `env`.

    A strategy is about the label `goal`, by default all. It hears of each episode that ends, not of those that `reset`
    interrupts; `success` is the entry of `info` that judges it, and `info["outcome"]` is what it was told. The wrapper
    is also a world of a suite (`scenegen suite run`): `reset(options={"start": start})` begins with that start, and
    `info["success"]` is the judgement.

    Raises RequestError for arguments that are none, and at `reset` where no scene has the requested phi.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        spec: Spec,
        phi: Wanted = None,
        *,
        put: Put,
        observe: Callable[[Any], Any],
        get: Get | None = None,
        quaternion: Literal["wxyz", "xyzw"],
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        turn: float = 0.0,
        origins: Origins = "base",
        up: Mapping[str, Axis] | None = None,
        goal: str | None = None,
        success: str = "is_success",
        ahead: int = STARTS_AHEAD,
        seed: int = 0,
        timeout: float = 60.0,
    ) -> None:
        super().__init__(env)
        check_spec(spec)
        for name, call in (("put", put), ("observe", observe), ("get", get)):
            if not callable(call) and (name != "get" or call is not None):
                raise RequestError(WRONG_VALUE(argument=name, value=repr(call), wanted="a function"))
        self.table = spec
        self.start: Start | None = None
        self._put, self._observe, self._get = put, observe, get
        self._order = quaternion_order(quaternion)
        self._frame = TableFrame(as_point("origin", origin), as_number("turn", turn))
        self._origins, self._up = origins, {} if up is None else up
        self._header = make_header(spec.checked, {}, RequestData(phi={}, n=1, spread="flat"))
        self._strategy, self._success = phi if is_strategy(phi) else None, success
        if as_int("ahead", ahead) < 1:
            raise RequestError(OUT_OF_RANGE(argument="ahead", value=ahead, wanted="1 or more"))
        seed, timeout = as_int("seed", seed), as_seconds("timeout", timeout)
        self._starts = make_starts(spec, phi, goal, seed, timeout, ahead)
        self._reset_phi: Phi | PhiBox | None = None  # by the options of a reset
        self._ranges = RangeStarts(spec, lambda: self._reset_phi, seed, timeout, ahead)
        self._rng = np.random.default_rng([seed, EPISODE_STARTS_STREAM])
        self._total, self._steps, self._reported = 0.0, 0, True

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Begin an episode from the next scene, from one with phi in `options["phi"]`, or from `options["start"]`."""
        rest = dict(by_name("options", {} if options is None else options, 'options by name: {"phi": (-0.1, 0)}'))
        given, self._reset_phi = rest.pop("start", None), rest.pop("phi", None)
        if given is not None and self._reset_phi is not None:
            raise RequestError(CONFLICTING_ARGUMENTS(one="start", other="phi"))
        names, shape = self.table.objects, np.shape(getattr(given, "poses", ()))
        if given is not None and (shape != (len(names), 7) or getattr(given, "objects", names) != names):
            wanted = "a start of the same objects, such as suite[i]"
            raise RequestError(WRONG_VALUE(argument="start", value=repr(given), wanted=wanted))
        if seed is not None:
            self._rng = np.random.default_rng([seed, EPISODE_STARTS_STREAM])
        source: StartSource = self._starts if self._reset_phi is None else self._ranges
        choose = getattr(source, "choose", None)
        start: Start = given or (source.take() if choose is None else choose(self._rng))
        _, info = self.env.reset(seed=seed, options=rest or None)
        frame = self._frame
        poses = poses_in_world(self._header, start.poses[None], frame.origin, frame.turn, self._origins, self._up)
        for name, pose in zip(self.table.objects, poses[0][:, self._order], strict=True):
            self._put(self.unwrapped, name, pose)
        self.start, self._total, self._steps, self._reported = start, 0.0, 0, False
        rest = {key: value for key, value in info.items() if key != self._success}  # judged before things were put
        return self._observe(self.unwrapped), {**rest, "phi": dict(start.phi)}

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """A step of the environment; at the end of the episode the strategy hears of it."""
        observation, reward, terminated, truncated, info = self.env.step(action)
        self._total, self._steps = self._total + float(reward), self._steps + 1
        if (terminated or truncated) and not self._reported:
            self._reported = True
            info = {**info, **self._report(info)}
        if self._success in info:
            info = {**info, "success": as_success(str(self.env), info, self._success)}
        return observation, reward, terminated, truncated, info

    def phi_now(self) -> dict[str, float]:
        """phi of each label where the objects are now. An object that the spec holds counts as in its place; raises
        RequestError where it is off by more than 1 mm or 0.01 rad, without `get`, and before the first start."""
        start = require_start(self.start)
        return phi_at(self.table, start, self.poses_now())

    def poses_now(self) -> Array:
        """(N, 3): where the spec's objects are now, in the spec's frame: x and y in metres, heading in radians. Those
        of which `get` gives no pose are where the start put them. Raises RequestError as `phi_now` does."""
        start = require_start(self.start)
        if self._get is None:
            raise RequestError(MISSING_ARGUMENT(argument="get", question="say how to read a pose back: get=function"))
        back = np.argsort(self._order)
        found = np.empty((len(self.table.objects), 3))
        for which, name in enumerate(self.table.objects):
            given = self._get(self.unwrapped, name)
            if given is None:
                found[which] = flat(start.poses[which])
                continue
            numbers = np.asarray(as_list(given), dtype=np.float64)
            if numbers.shape != (7,):
                wanted = "x, y, z and a quaternion, 7 numbers"
                raise RequestError(WRONG_VALUE(argument=f"get(env, {name!r})", value=repr(given), wanted=wanted))
            pose = numbers[back]
            found[which] = self._frame.pose(pose[:3], times(pose[3:], inverse(UP_TURNS[self._up.get(name, "z")])))
        return found

    def _report(self, info: Mapping[str, Any]) -> dict[str, Any]:
        """Report the outcome of the episode to the strategy; what `info` then has of it."""
        start = require_start(self.start)
        if self._strategy is None or not isinstance(start.task, PhiBox):
            return {}  # an own source of starts may have tasks of other kinds
        if self._success not in info:
            raise RequestError(UNKNOWN_CHOICE(what="entry of info", name=self._success, known=tuple(info)))
        success = as_success(str(self.env), info, self._success)
        outcome = report_outcome(self._strategy, start, success, self._total, self._steps)
        return {} if outcome is None else {"outcome": outcome.info()}


def keep_clear(spec: Spec, x: float, y: float, radius: float) -> Spec:
    """`spec`, which also requires that no object that can move comes closer than `radius`, in metres, to a point of the
    table: where the hand of a robot is at rest, which would throw a thing that starts there. Objects that are no
    bodies, such as the mark of a goal, keep clear as well; to leave some out, write it in the spec:
    `require gap(mug, (0.1, 0.2)) >= 6 cm`. Raises RequestError, and SpecError where the spec then cannot hold."""
    check_spec(spec)
    at, least = f"({as_number('x', x):.9f}, {as_number('y', y):.9f})", as_number("radius", radius)
    if least <= 0:
        raise RequestError(OUT_OF_RANGE(argument="radius", value=radius, wanted="more than 0"))
    checked = spec.checked
    apart = [f"gap({name}, {at}) >= {least:.9f}" for k, name in enumerate(spec.objects) if k not in checked.fixed]
    text = f"{spec.source.rstrip()}\nrequire {' & '.join(apart)}\n"
    return Spec(replace(check_text(text, checked.name), title=checked.title))
