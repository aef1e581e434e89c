"""A drop-in for the `placement_initializer` of robosuite's environments: objects start where a spec wants them.

Starts are verified scenes, drawn ahead: at a range of phi, or at the next task of a strategy. They are placed in the
simulator's frame, and read back from it. libero/ makes files of states, of robosuite's environments, too.
"""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, TypeAlias

import numpy as np

from scenegen.api.spec import Spec, check_spec
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.files import SAME_NAME
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.errors.worlds import PLACEMENT
from scenegen.play.frame import TableFrame, flat, inverse, times
from scenegen.play.starts import Start, Wanted, make_starts, phi_at, report_outcome, require_start
from scenegen.play.tasks import is_strategy
from scenegen.validation import as_int, as_number, as_point, as_seconds

Placed: TypeAlias = dict[str, tuple[tuple[float, float, float], Array, Any]]
"""Object name -> (place, quaternion (w, x, y, z), object), as robosuite's samplers give it."""

MAX_SCENES_TRIED = 1000  # scenes that are tried until one keeps clear of fixtures


class Placement:
    """Places the objects of an environment as a spec wants them, at a requested phi.

    `phi` is a range as `scenegen.sample` takes it, a strategy of `scenegen.curriculum`, or a function that gives a
    range for each reset. `goal` is the label that a strategy is about. `names` maps objects of the spec to names in
    the environment; others have the same name in both. The spec's coordinates are relative to `reference_pos`, metres
    in the world, and turned by `turn` radians: with -pi / 2, the spec's x axis points to the right as the robot sees
    it, and its y axis away from the robot. `z_offset`, one for all or by object of the environment, lifts objects above
    what they stand on. `rest` places the objects that the spec does not have. Objects may be given here or by the
    environment (`add_objects`). The same seed and requests give the same scenes.

    Raises RequestError for arguments that are none, and `sample` raises it where no scene has the requested phi.
    """

    def __init__(
        self,
        spec: Spec,
        phi: Wanted = None,
        *,
        names: Mapping[str, str] | None = None,
        reference_pos: Iterable[float] = (0.0, 0.0, 0.0),
        turn: float = 0.0,
        z_offset: float | Mapping[str, float] = 0.0,
        goal: str | None = None,
        rest: Any = None,
        mujoco_objects: Any = None,
        ensure_valid_placement: bool = True,
        seed: int = 0,
        timeout: float = 60.0,
        name: str = "Placement",
    ) -> None:
        check_spec(spec)
        self.name, self.spec, self.rest = name, spec, rest
        self.names = _names(spec, {} if names is None else names)
        self.reference_pos = as_point("reference_pos", reference_pos)
        self.turn = as_number("turn", turn)
        self.z_offset = (
            {key: as_number(f"z_offset[{key!r}]", lift) for key, lift in z_offset.items()}
            if isinstance(z_offset, Mapping)
            else as_number("z_offset", z_offset)
        )
        self.ensure_valid_placement = ensure_valid_placement
        self.mujoco_objects: list[Any] = []
        self.start: Start | None = None
        self._strategy = phi if is_strategy(phi) else None
        self._starts = make_starts(spec, phi, goal, as_int("seed", seed), as_seconds("timeout", timeout))
        self._frame = TableFrame(self.reference_pos, self.turn)
        if mujoco_objects is not None:
            self.add_objects(mujoco_objects)

    def add_objects(self, mujoco_objects: Any) -> None:
        """More objects of the environment: one, or a list of them."""
        several = isinstance(mujoco_objects, list | tuple)
        self.mujoco_objects += mujoco_objects if several else [mujoco_objects]

    def reset(self) -> None:
        """Forget the objects; environments do this before they add those of a new model."""
        self.mujoco_objects = []

    def use_in(self, env: Any) -> None:
        """Replace the sampler of an environment that takes none, such as PickPlace, from its next reset on. Its own
        sampler goes on to place the objects that the spec does not have."""
        env = getattr(env, "unwrapped", env)
        make = getattr(env, "_get_placement_initializer", None)

        def replace() -> None:
            own = env.placement_initializer
            self.mujoco_objects, self.rest = list(own.mujoco_objects), own
            env.placement_initializer = self

        if make is not None:

            def remake() -> None:
                make()
                replace()

            env._get_placement_initializer = remake  # called for each new model
        replace()

    def sample(self, fixtures: Placed | None = None, reference: Any = None, on_top: bool = True) -> Placed:
        """The next scene: every object's place, quaternion and model, and what `fixtures` has.

        `reference` is the name of a fixture, on whose top the scene then is (`on_top`), or a point that takes the place
        of `reference_pos`. Raises RequestError where no scene has the requested phi or keeps clear of the fixtures, and
        for objects that spec and environment do not share.
        """
        placed: Placed = dict(fixtures or {})
        objects = self._objects(placed)
        self._frame = TableFrame(self._origin(placed, reference, on_top), self.turn)
        for _ in range(MAX_SCENES_TRIED):
            start = self._starts.take()
            found = self._place(start, objects, on_top)
            if not (placed and self.ensure_valid_placement) or _clear(found, placed):
                break
        else:
            raise RequestError(PLACEMENT(tried=MAX_SCENES_TRIED, fixtures=tuple(placed)))
        self.start = start
        placed |= found
        left = [one for one in self.mujoco_objects if one.name not in placed]
        return _rest(self.rest, left, placed) if left else placed

    @property
    def phi(self) -> dict[str, float]:
        """phi of the last start, by label. Raises RequestError before the first."""
        return dict(require_start(self.start).phi)

    def poses(self, sim: Any) -> Array:
        """(N, 3): where the spec's objects are in a simulation now, in the spec's frame: x and y in metres, heading in
        radians. Objects that the environment does not have are where the start put them. Raises RequestError before
        the first start."""
        start = require_start(self.start)
        there = {one.name: one for one in self.mujoco_objects}
        found = np.empty((len(self.spec.objects), 3))
        for which, own in enumerate(self.spec.objects):
            model = there.get(self.names[own])
            if model is None:
                pose = start.poses[which]
                found[which] = flat(pose)
                continue
            body = sim.model.body_name2id(model.root_body)
            attitude = times(sim.data.body_xquat[body], inverse(_attitude(model)))
            found[which] = self._frame.pose(sim.data.body_xpos[body], attitude)
        return found

    def phi_in(self, sim: Any) -> dict[str, float]:
        """phi of each label where the objects are in a simulation now. An object that the spec holds counts as in its
        place; raises RequestError where it is off by more than 1 mm or 0.01 rad, and before the first start."""
        return phi_at(self.spec, require_start(self.start), self.poses(sim))

    def report(self, success: bool, total: float = 0.0, steps: int = 0) -> None:
        """Tell the strategy how the episode ended that began with the last start; nothing without a strategy."""
        report_outcome(self._strategy, require_start(self.start), bool(success), float(total), int(steps))

    def _objects(self, placed: Placed) -> list[tuple[int, Any]]:
        """The spec's objects by number, each with its model; those that are held in place may have none."""
        there = {one.name: one for one in self.mujoco_objects}
        twice = tuple(name for name in self.names.values() if name in placed)
        if twice:
            raise RequestError(PLACEMENT(fixed=twice))
        found = []
        for which, name in enumerate(self.names.values()):
            if name in there:
                found.append((which, there[name]))
            elif which not in self.spec.checked.fixed:
                raise RequestError(PLACEMENT(name=name, known=tuple(there)))
        strangers = tuple(name for name in there if name not in {*self.names.values(), *placed})
        if strangers and self.rest is None:
            raise RequestError(PLACEMENT(strangers=strangers))
        return found

    def _origin(self, placed: Placed, reference: Any, on_top: bool) -> tuple[float, float, float]:
        if reference is None:
            return self.reference_pos
        if not isinstance(reference, str):
            return as_point("reference", reference)
        if reference not in placed:
            raise RequestError(PLACEMENT(reference=reference, known=tuple(placed)))
        at, _, model = placed[reference]
        x, y, z = as_point("reference", at)
        return x, y, z + (float(model.top_offset[-1]) if on_top else 0.0)

    def _place(self, start: Start, objects: list[tuple[int, Any]], on_top: bool) -> Placed:
        found: Placed = {}
        for which, model in objects:
            (x, y, z), quaternion = self._frame.place(start.poses[which].tolist())
            lift = self.z_offset
            z += lift.get(model.name, 0.0) if isinstance(lift, dict) else lift
            if on_top:
                z -= model.bottom_offset[-1]
            found[model.name] = (float(x), float(y), float(z)), times(quaternion, _attitude(model)), model
        return found


def _attitude(model: Any) -> Array:
    """The quaternion of an object that stands as it should at heading 0."""
    found = getattr(model, "init_quat", None)
    return np.array([1.0, 0.0, 0.0, 0.0] if found is None else found, dtype=np.float64)


def _names(spec: Spec, names: Mapping[str, str]) -> dict[str, str]:
    """The environment's name of each object of the spec. Raises RequestError."""
    if not isinstance(names, Mapping):
        wanted = 'names by name: names={"mug": "Can"}'
        raise RequestError(WRONG_VALUE(argument="names", value=repr(names), wanted=wanted))
    for own in names:
        if own not in spec.objects:
            raise RequestError(UNKNOWN_CHOICE(what="object", name=str(own), known=spec.objects))
    found = {own: names.get(own, own) for own in spec.objects}
    for name, count in Counter(found.values()).items():
        if count > 1:
            raise RequestError(SAME_NAME(name=name, objects="objects"))
    return found


def _clear(found: Placed, fixtures: Placed) -> bool:
    """Whether no object is over a fixture, by the test of robosuite: circles around both, or one above the other."""
    for (x, y, z), _, model in found.values():
        for (a, b, c), _, other in fixtures.values():
            near = np.hypot(x - a, y - b) <= other.horizontal_radius + model.horizontal_radius
            if near and z - c <= other.top_offset[-1] - model.bottom_offset[-1]:
                return False
    return True


def _rest(sampler: Any, left: list[Any], placed: Placed) -> Placed:
    """The objects that remain, placed by robosuite's samplers, which keep clear of what is placed."""
    for part in getattr(sampler, "samplers", {"": sampler}).values():
        mine = [one for one in left if any(one is other for other in part.mujoco_objects)]
        if mine:
            own = copy.copy(part)
            own.mujoco_objects = mine
            placed = own.sample(fixtures=placed)
    missing = tuple(one.name for one in left if one.name not in placed)
    if missing:
        raise RequestError(PLACEMENT(strangers=missing))
    return placed
