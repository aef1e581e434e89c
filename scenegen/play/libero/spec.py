"""A live environment -> the text of a spec: prisms of its things as they stand, sites, fixtures, joints.

A joint of the goal is an object too: a slider on a track over the scene, whose x is how far the part has travelled, in
metres. So phi says by how much a drawer is not open.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np

from scenegen.api.spec import Spec, parse
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.geometry import NUMPY
from scenegen.geometry.clearance import gap
from scenegen.geometry.footprint import Polygon, Rectangle
from scenegen.planning.setting import enclosing
from scenegen.planning.translation import grow, overlap
from scenegen.play.frame import TableFrame, heading_of, upright
from scenegen.play.libero.measure import Floor, JointPart, LiveModel, PrismShape, prism_of
from scenegen.play.libero.robots import robot_statements
from scenegen.play.libero.sight import AGENT_VIEW, LiveCamera, still_cameras

Fact: TypeAlias = tuple[str, ...]  # a predicate and names
Origin: TypeAlias = tuple[float, float, float]
Prisms: TypeAlias = Mapping[str, PrismShape]
JOINTS = {"open": "is_open", "close": "is_close", "turnon": "turn_on", "turnoff": "turn_off"}  # LIBERO's methods
PLACE_PREDICATES = ("on", "in", "stack")
FIXTURE_HEIGHT = 0.006  # of one whose compartments are used: things on the table keep clear of its outline
LOW_SHAPE = 0.03  # shapes of such a fixture that begin higher leave room on the table
START_TURN = 0.02  # radians by which things are turned from their own heading at the start, at most
ON_DISTANCE = 0.03  # LIBERO's: the centres of what is on a thing and of the thing
JOINT_MARGIN = 0.02  # the part of a joint's range that a goal keeps from its ends
PUSH = 0.001  # metres by which a wall of a fixture that stands elsewhere may push a thing
TRACK = 2.0  # metres over the table, where sliders are


@dataclass(frozen=True, slots=True, eq=False)
class EnvironmentSpec:
    """The spec of a live environment, and what ties the two together.

    `origin` is the spec's (0, 0) on the ground in the world, in metres; `prisms` and `attitudes` (quaternions w, x, y,
    z at heading 0) are those of the things that move; `sliders` the joints by object of the spec: its x is the joint
    times its lever; `facts` the initial facts; `moved` the things that the goal puts somewhere; `tight` the sites of
    fixtures at which it has things; `ends` (K, 7) poses of fixtures in the world, at the ends of the regions in which
    resets put them; `sight` whether it has the label `visible`.
    """

    text: str
    spec: Spec
    live: LiveModel = field(repr=False)
    origin: Origin
    prisms: Prisms
    attitudes: Mapping[str, Array]
    sliders: Mapping[str, JointPart]
    facts: tuple[Fact, ...]
    moved: frozenset[str]
    tight: Mapping[str, str]
    ends: Mapping[str, Array]
    sight: bool


def spec_of(env: Any, more: str = "", *, anywhere: bool = True, sight: bool = False) -> EnvironmentSpec:
    """The spec of an environment of LIBERO or robosuite, which has been reset.

    It has the robot, `arm`, where its base stands. LIBERO's has its camera `agentview`, robosuite's those that stand
    still and whose pictures are level, all square. LIBERO's has the labels `goal` and, where the goal moves something,
    `start`; with `sight` also `visible`, whose phi is the share of what the goal moves that the camera sees, the least
    of several, and its things are as large as they are drawn. `more` are statements to add, such as the labels of a
    task of robosuite's. The goal holds wherever LIBERO's resets put the fixtures, unless `anywhere` is false: then it
    is that of the scene as it is now, for `set_scene`. Raises RequestError for a goal of LIBERO's that has no form
    here, and for `sight` where it moves nothing; SpecError for statements that do not check.
    """
    live = LiveModel(env)
    task = hasattr(live.env, "parsed_problem")
    samplers = [] if task else _samplers(live.env)
    x, y, z = map(float, live.env.workspace_offset if task else samplers[0].reference_pos)
    origin = x, y, live.ground((x, y, z))
    names = [one.name for part in samplers for one in part.mujoco_objects if one.name in live.movers]
    stand = {name: live.attitude(name) for name in (live.movers if task else names)}
    prisms = {name: prism_of(live.points(name, drawn=sight), attitude) for name, (attitude, _) in stand.items()}
    maker = _Task(live, origin, prisms, {name: heading for name, (_, heading) in stand.items()}, anywhere)
    text = maker.text() if task else _plain(live, origin, prisms, samplers)
    text += "".join(f"\n{one.strip()}\n" for one in (maker.sight() if sight else "", more) if one)
    attitudes = {name: attitude for name, (attitude, _) in stand.items()}
    spec = parse(text, "the environment's spec")
    return EnvironmentSpec(
        text,
        spec,
        live,
        origin,
        prisms,
        attitudes,
        maker.sliders,
        tuple(maker.facts),
        frozenset(maker.moved),
        maker.tight,
        maker.ends,
        sight,
    )


def _samplers(env: Any) -> list[Any]:
    made = getattr(env, "placement_initializer", None)
    found = list(getattr(made, "samplers", {"": made}).values())
    if not found or not hasattr(found[0], "reference_pos"):
        wanted = "an environment of LIBERO, or one of robosuite's that places its objects with samplers"
        raise RequestError(WRONG_VALUE(argument="env", value=type(env).__name__, wanted=wanted))
    return found


def _plain(live: LiveModel, origin: Origin, prisms: Prisms, samplers: Sequence[Any]) -> str:
    """The objects of robosuite's samplers, on the rectangle that these use."""
    boxes = []
    for one in samplers:
        if not any(each.name in prisms for each in one.mujoco_objects):
            continue  # it places marks
        x, y = (np.asarray(one.reference_pos, dtype=np.float64) - origin)[:2]
        (left, right), (bottom, top) = one.x_range, one.y_range
        boxes.append((x + left, y + bottom, x + right, y + top))
    lines = [f"# {type(live.env).__name__}, as it is now; metres", _workspace(enclosing(boxes)), ""]
    lines += [camera.statement(origin) for camera in still_cameras(live)]
    lines += ["", *robot_statements(live, origin, prisms), ""]
    lines += [f"object {name} = {prism.text()}" for name, prism in prisms.items()]
    return "\n".join([*lines, "require noOverlap()", ""])


class _Task:
    """A task of LIBERO's, as its environment has read it, in the words of the language."""

    def __init__(
        self, live: LiveModel, origin: Origin, prisms: Prisms, headings: Mapping[str, float], anywhere: bool
    ) -> None:
        self.live, self.origin, self.prisms, self.headings = live, origin, prisms, headings
        self.problem = getattr(live.env, "parsed_problem", {})
        self.goal, self.facts = (
            [(one[0].lower(), *one[1:]) for one in self.problem.get(key, ())] for key in ("goal_state", "initial_state")
        )
        regions = self.problem.get("regions", {})
        self.zones = {name: _box(one["ranges"][0]) for name, one in regions.items() if one["ranges"]}
        sites = getattr(live.env, "object_sites_dict", {})
        self.sites = {name: one for name, one in sites.items() if getattr(one, "parent_name", None)}
        self.sliders: dict[str, JointPart] = {}
        self.tight: dict[str, str] = {}
        self.regions: list[str] = []  # statements
        self.require: list[str] = []
        self.floors: dict[str, Floor] = {}
        self.ends = self._ends() if anywhere else {}
        self.asked = self._goal_joints()
        self.stands: dict[str, tuple[PrismShape, float, float, float]] = {}  # after the reset: x, y, heading
        for name, prism in prisms.items():
            x, y = (live.start[live.movers[name] :][:2] - origin[:2]).tolist()
            self.stands[name] = prism, x, y, headings[name]
        self.moved = {one[1] for one in self.goal if one[0] in PLACE_PREDICATES}

    def _goal_joints(self) -> dict[Fact, list[tuple[JointPart, tuple[float, float]]]]:
        """The joints of the goal, each with the range that LIBERO accepts. A drawer into which the goal puts something
        is out, if it is not asked to be in."""
        wanted = [one for one in self.goal if one[0] in JOINTS]
        named = {part.name for one in wanted for part in self._joints(one)}
        for one in self.goal:
            if one[0] in PLACE_PREDICATES and one[-1] in self.sites and self.sites[one[-1]].joints:
                out = ("open", one[-1])
                part = self._joints(out)[0]
                if part.name not in named and not self._holds(out, float(self.live.start[part.address])):
                    wanted.append(out)
        return {one: self._accepted_range(one) for one in wanted}

    def _joints(self, fact: Fact) -> list[JointPart]:
        found = self.sites.get(fact[1]) or self.live.env.get_object(fact[1])
        return [self.live.parts[name] for name in found.joints]

    def _holds(self, fact: Fact, value: float) -> bool:
        owner = self.live.env.get_object(getattr(self.sites.get(fact[1]), "parent_name", fact[1]))
        return bool(getattr(owner, JOINTS[fact[0]])(value))

    def _accepted_range(self, fact: Fact) -> list[tuple[JointPart, tuple[float, float]]]:
        found = []
        for part in self._joints(fact):
            run = self.live.accepted_range(part, lambda value: self._holds(fact, value))
            if run is None:
                raise RequestError(WRONG_VALUE(argument="env", value=" ".join(fact), wanted="a joint that can do that"))
            found.append((part, run))
        return found

    def _slider(self, part: JointPart) -> str:
        """The object of a joint."""
        name = "".join(one if one.isalnum() and one.isascii() else "_" for one in part.name)
        if name not in self.sliders:
            box, height = (part.low * part.lever, 0.0, part.high * part.lever, 0.001), TRACK + 0.1 * len(self.sliders)
            self.regions.append(f"region {name}_track = {_rect(box)} at {height:g} m")
            self.sliders[name] = part
        return name

    def _state(self, ranges: Iterable[tuple[JointPart, tuple[float, float]]]) -> list[str]:
        """That joints are in ranges that LIBERO accepts, by 2 % of them."""
        texts = []
        for part, (low, high) in ranges:
            name, margin = self._slider(part), JOINT_MARGIN * (high - low)
            if low > part.low + 1e-9:
                texts.append(f"x({name}) >= {_n((low + margin) * part.lever)} m")
            if high < part.high - 1e-9:
                texts.append(f"x({name}) <= {_n((high - margin) * part.lever)} m")
        return texts

    def _joints_at_start(self) -> list[str]:
        """Where the joints of the goal are at the start: as a fact has it, or as the reset left them."""
        found, left = [], dict(self.sliders)
        for fact in self.facts:
            if fact[0] in JOINTS and any(part in left.values() for part in self._joints(fact)):
                found += self._state(self._accepted_range(fact))
                left = {name: part for name, part in left.items() if part not in self._joints(fact)}
        for name, part in left.items():
            at = float(np.clip(self.live.start[part.address], part.low, part.high)) * part.lever
            found.append(f"abs(x({name}) - ({_n(at)} m)) <= 0.5 mm")
        return found

    def _ends(self) -> dict[str, Array]:
        """(K, 7): the poses of each fixture in the world, at the ends of the region in which resets put it."""
        found = {}
        for name, zone in (fact[1:] for fact in self.facts if fact[0] in PLACE_PREDICATES):
            if name in self.live.fixtures and zone in self.zones:
                region, (_, _, z, *attitude) = self.problem["regions"][zone], self.live.fixed[name]
                left, bottom, right, top = enclosing([_box(one) for one in region["ranges"]])
                ends = itertools.product((left, right), (bottom, top), sorted({*region["yaw_rotation"]}))
                frames = [TableFrame((x + self.origin[0], y + self.origin[1], z), turn) for x, y, turn in ends]
                found[name] = np.array(
                    [np.concatenate(one.place((0.0, 0.0, 0.0, *upright(attitude)))) for one in frames]
                )
        return found

    def _everywhere(self, box: Rectangle, fixture: str, push: float = 0.0) -> Rectangle:
        """What of a rectangle at a fixture is there wherever the fixture may stand, turned as it is, and `push` metres
        more; 1 mm in the middle where that is nothing."""
        now = self.live.fixed[fixture]
        ends = (self.ends.get(fixture, now[None]) - now)[:, :2]
        low = box[:2] + np.maximum(ends.max(axis=0) - push, 0.0)
        high = box[2:] + np.minimum(ends.min(axis=0) + push, 0.0)
        middle = (low + high) / 2.0
        return *np.minimum(low, middle - 0.0005).tolist(), *np.maximum(high, middle + 0.0005).tolist()

    def _floor(self, site: str) -> Floor:
        """The floor of a fixture's site, in the spec's frame, declared as a region: what of it is there wherever the
        fixture may stand. Where a fact has something there at the start, its drawer is as the reset left it, else as
        the goal wants it."""
        if site not in self.floors:
            own = self.sites[site]
            joints = {part.name: sum(run) / 2.0 for ranges in self.asked.values() for part, run in ranges}
            if any(one[-1] == site and one[0] in PLACE_PREDICATES for one in self.facts):
                joints = {}
            found = self.live.floor(site, np.asarray(own.size, dtype=np.float64), own.parent_name, joints)
            x, y, z = self.origin
            shared = self._everywhere(found.rectangle, own.parent_name)
            walls = shared if found.free == found.rectangle else self._everywhere(found.free, own.parent_name, PUSH)
            own_box, free = ((a - x, b - y, c - x, d - y) for a, b, c, d in (shared, walls))
            self.floors[site] = floor = Floor(own_box, free, max(round(found.height - z, 4), FIXTURE_HEIGHT + 0.0005))
            self.regions.append(f"region {site} = {_rect(floor.rectangle)} at {_n(floor.height)} m")
            if floor.free != floor.rectangle:
                self.regions.append(f"region {site}_walls = {_rect(floor.free)}")
        return self.floors[site]

    def _carrier(self, name: str) -> tuple[str, str]:
        """The surface that a name of a fact means: `zone`, `site` of a fixture, or `thing`, and its name."""
        owner = getattr(self.sites.get(name), "parent_name", name)
        if owner in self.live.movers:
            return "thing", owner
        if name in self.zones or name in self.sites:
            return "zone" if name in self.zones else "site", name
        known = (*self.zones, *self.sites, *self.live.movers)
        raise RequestError(UNKNOWN_CHOICE(what="place", name=name, known=known))

    def _place(self, fact: Fact) -> str:
        """What LIBERO asks of a thing on or in something, as a formula. What keeps it from walls is required."""
        _, upper, name = fact
        kind, lower = self._carrier(name)
        if kind == "zone":
            return f"restsOn({upper}, {lower}, 5 mm)"
        if kind == "site":
            floor = self._floor(lower)
            rests = f"restsOn({upper}, {lower}, {_n(min(floor.height / 2.0, 0.02))} m)"
            if floor.free != floor.rectangle and self._fits(upper, floor.free):
                self.require.append(f"require !{rests} | inside({upper}, {lower}_walls)")
            return rests
        rests, apart = f"restsOn({upper}, {lower}, 1 cm)", f"dist({upper}, {lower})"
        if name == lower:
            return f"{rests} & {apart} <= {ON_DISTANCE:g} m"
        half = float(np.sort(np.abs(np.asarray(self.sites[name].size, dtype=np.float64))[:2])[0])
        alone = sum(one[-1] == name for one in self.goal) < 2
        room = min(max(half - 0.9 * self.prisms[upper].reach, 0.012 if alone else 0.042), half)
        self.require.append(f"require !{rests} | {apart} <= {_n(room)} m")
        return f"{rests} & {apart} <= {_n(half)} m"

    def _fits(self, name: str, free: Rectangle) -> bool:
        """Whether a thing as it stands fits between walls, straight."""
        room, extents = np.sort([free[2] - free[0], free[3] - free[1]]), np.ptp(self.prisms[name].corners, axis=0)
        return bool((np.sort(extents) <= room).all())

    def _angle(self, name: str) -> str:
        """The headings that LIBERO gives a thing: that after the reset, or the range of its class."""
        heading, half = self.headings[name], START_TURN
        model = self.live.env.get_object(name)
        turn = getattr(model, "rotation", None)
        if getattr(model, "rotation_axis", None) == "x" and isinstance(turn, tuple | list) and len(turn) == 2:
            middle = math.pi - (turn[0] + turn[1]) / 2.0  # LIBERO's x, y, z, w are MuJoCo's w, x, y, z
            width = abs(turn[1] - turn[0]) / 2.0
            if abs(math.remainder(heading - middle, 2.0 * math.pi)) <= width + 1e-6:
                heading, half = middle, max(width, START_TURN)
        return f"angle({name}, {_n(heading % (2.0 * math.pi))} rad, {_n(half)} rad)"

    def text(self) -> str:
        places: dict[str, list[str]] = {name: ["workspace"] * (name in self.moved) for name in self.live.movers}
        boxes: dict[str, Rectangle] = {}
        start: list[str] = []
        goal: list[str] = []
        for fact in self.facts:
            if fact[0] not in PLACE_PREDICATES or fact[1] not in self.live.movers:
                continue
            name, (kind, lower) = fact[1], self._carrier(fact[2])
            if name in self.moved:
                places[name] += [lower] * (kind != "zone")
                start += [self._place(fact), self._angle(name)]
                continue
            places[name].append(lower)
            self.require.append(f"require {self._angle(name)}")
            if kind == "zone":
                boxes[name] = self.zones[lower]
            elif kind == "thing":
                self.require.append(f"require dist({name}, {lower}) <= 1 cm")
            else:
                self._place(fact)
        for fact in self.goal:
            if fact[0] in PLACE_PREDICATES and fact[1] in self.live.movers:
                kind, lower = self._carrier(fact[2])
                goal.append(self._place(fact))
                places[fact[1]] += [lower] * (kind != "zone")
                self.tight |= {fact[1]: lower} if kind == "site" else {}
            elif fact not in self.asked:
                known = (*PLACE_PREDICATES, *JOINTS)
                raise RequestError(UNKNOWN_CHOICE(what="predicate of LIBERO's", name=fact[0], known=known))
        for ranges in self.asked.values():
            goal += self._state(ranges)
        start += self._joints_at_start()
        fixtures = self._fixtures()
        words = self.problem["language_instruction"]
        used = {name for fact in (*self.facts, *self.goal) if fact[1] in self.live.movers for name in fact[2:]}
        tracks = [(one.low * one.lever, 0.0, one.high * one.lever, 0.001) for one in self.sliders.values()]
        space = grow(enclosing([*self.zones.values(), *(one for _, one in fixtures.values()), *tracks]), 0.05)
        lines = [
            f"# {words if isinstance(words, str) else ' '.join(words)}",
            "# From LIBERO's environment as it is now; metres, from the middle of its workspace.",
            *("", _workspace(space), ""),
            *(f"region {name} = {_rect(one)}" for name, one in self.zones.items() if name in used),
            *(*self.regions, ""),
            *(LiveCamera(self.live).statement(self.origin), ""),
            *(*robot_statements(self.live, self.origin, [*fixtures, *self.prisms]), ""),
            *(f"object {name} = {text}" for name, (text, _) in fixtures.items()),
        ]
        for name, prism in self.prisms.items():
            on = list(dict.fromkeys(places[name])) or ["workspace"]
            surfaces = on[0] if len(on) == 1 else f"any of [{', '.join(on)}]"
            lines.append(f"object {name} = {prism.text()} on {surfaces}")
        lines += [f"object {name} = cylinder(0.0002, 0.001) on {name}_track" for name in self.sliders]
        boxes |= {name: box for name, (_, box) in fixtures.items()}
        lines += ["", *self._clearance_terms(boxes), *dict.fromkeys(self.require), ""]
        lines += [f"start: {' & '.join(dict.fromkeys(start))}"] * bool(start)
        return "\n".join([*lines, f"goal: {' & '.join(dict.fromkeys(goal))}", ""])

    def sight(self) -> str:
        """What the camera sees of what the goal moves, as statements. Raises RequestError."""
        if not self.moved:
            wanted = "a task whose goal puts a thing somewhere"
            raise RequestError(WRONG_VALUE(argument="visible", value="the share of nothing", wanted=wanted))
        shares = [f"visibleShare({name}, {AGENT_VIEW}) >= 0 %" for name in sorted(self.moved)]
        pictured = [f"require inView({name}, {AGENT_VIEW})" for name in sorted(self.moved)]
        return "\n".join([*pictured, f"visible: {' & '.join(shares)}"])

    def _fixtures(self) -> dict[str, tuple[str, Rectangle]]:
        """The shape and pose of each fixture, and the rectangle around it."""
        found = {}
        with self.live.without_movers():
            for name in self.live.fixtures:
                points, body = self.live.points(name), self.live.things[name]
                if not len(points):
                    continue
                x, y, z = self.live.data.xpos[body] - np.array(self.origin)
                quaternion = self.live.data.xquat[body].copy()
                prism = prism_of(points, upright(quaternion))
                height = max(float(z) + prism.top, FIXTURE_HEIGHT)
                floors = [one.height for site, one in self.floors.items() if self.sites[site].parent_name == name]
                lowest = min(floors, default=math.inf)
                height = lowest if height - 0.002 <= lowest < height else height
                if lowest < height:  # something can be within it
                    height, prism = FIXTURE_HEIGHT, prism_of(self.live.points(name, LOW_SHAPE), upright(quaternion))
                heading = float(heading_of(quaternion))
                pose = f"({_n(x)}, {_n(y)}, {_n(heading % (2.0 * math.pi))} rad)"
                found[name] = f"{prism.text(height)} at {pose}", grow((x, y, x, y), prism.reach)
                self.stands[name] = prism, x, y, heading
        return found

    def _clear(self, one: str, other: str) -> bool:
        """Whether two hulls have 5 mm between them after the reset, seen from above."""
        (first, x, y, turn), (second, a, b, heading) = self.stands[one], self.stands[other]
        shapes = Polygon(first.corners), Polygon(second.corners)
        return bool(gap(NUMPY, *shapes, x, y, turn, a, b, heading) > 0.005)

    def _clearance_terms(self, boxes: Mapping[str, Rectangle]) -> list[str]:
        """Requirements for the pairs that could meet, but for those whose hulls do after the reset, such as what a
        handle reaches over; `boxes` are those of things whose place is known."""
        names = [*self.live.movers, *(name for name in boxes if name in self.live.fixtures)]
        found = []
        for one, other in itertools.combinations(names, 2):
            reach = sum(self.prisms[name].reach for name in (one, other) if name in self.prisms)
            known, fixed = one in boxes and other in boxes, {one, other} <= {*self.live.fixtures}
            could = not known or overlap(grow(boxes[one], reach), boxes[other])
            if could and not fixed and self._clear(one, other):
                found.append(f"require apart({one}, {other}) >= 0")
        return found


def _box(row: Sequence[float]) -> Rectangle:
    """A range of LIBERO's, at least 1 mm wide."""
    left, right, bottom, top = min(row[0], row[2]), max(row[0], row[2]), min(row[1], row[3]), max(row[1], row[3])
    return left, bottom, max(right, left + 0.001), max(top, bottom + 0.001)


def _workspace(box: Rectangle) -> str:
    return f"workspace [{_n(box[0])}, {_n(box[2])}] x [{_n(box[1])}, {_n(box[3])}]"


def _rect(box: Rectangle) -> str:
    return f"rect({', '.join(map(_n, box))})"


def _n(value: float) -> str:
    return f"{round(float(value), 6) + 0.0:.10g}"
