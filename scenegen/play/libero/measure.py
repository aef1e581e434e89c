"""What a live environment has: bodies, their hulls, floors and walls by rays, joints. In the world's frame, metres.

Nothing here imports robosuite or LIBERO: an environment brings its own simulation.
"""

from __future__ import annotations

import contextlib
import io
import logging
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scenegen.arrays import Array
from scenegen.geometry.footprint import Rectangle, convex_hull
from scenegen.needs import need
from scenegen.play.frame import heading_of, rotate, upright

MAX_CORNERS = 12  # of a prism at most
ROBOT_OWNER = "the robot"
FLAT_SITE = 0.012  # half a site's height: a flat site is a surface, a higher one a compartment
UPRIGHT_COSINE = 0.95  # a site none of whose axes is as upright as this, by the cosine, is on a slope
RAY_GRID = np.linspace(-0.95, 0.95, 13)  # of rays onto a site, in parts of its half size
FLOOR_TOLERANCE = 0.006  # metres by which rays onto one floor differ
DRAWN_GROUP = 1  # of geoms: what pictures show
DOWNWARDS = (0.0, 0.0, -1.0)


@dataclass(frozen=True, slots=True)
class Floor:
    """Where a thing can stand at a site: the rectangle for its middle, `free` for all of it, up to the walls, and the
    height of the floor."""

    rectangle: Rectangle
    free: Rectangle
    height: float


@dataclass(frozen=True, slots=True)
class JointPart:
    """A joint of a fixture: its address in qpos, its range, and its lever: metres that the part travels for one unit
    of the joint, 1 of a drawer."""

    name: str
    address: int
    low: float
    high: float
    lever: float


@dataclass(frozen=True, slots=True)
class PrismShape:
    """A thing as an upright prism: its corners about the body's origin, and where it begins and ends above it."""

    corners: tuple[tuple[float, float], ...]
    bottom: float
    top: float

    def text(self, height: float | None = None) -> str:
        corners = ", ".join(f"({x:g}, {y:g})" for x, y in self.corners)
        return f"prism([{corners}], {max(round(height or self.top - self.bottom, 4), 0.001):g})"

    @property
    def reach(self) -> float:
        """How far the farthest corner is from the origin."""
        return max(math.hypot(x, y) for x, y in self.corners)


def prism_of(points: Array, attitude: Array) -> PrismShape:
    """The prism around points (n, 3) of a body at an attitude: the hull from above, of at most 12 corners, to 0.1 mm.
    Raises ValueError for points on one line."""
    turned = points @ matrix(attitude).T
    corners = np.array(convex_hull(map(tuple, turned[:, :2].tolist())).vertices)
    if len(corners) > MAX_CORNERS:
        turn = np.linspace(0.0, 2.0 * np.pi, MAX_CORNERS, endpoint=False)
        corners = corners[np.unique((corners @ np.stack([np.cos(turn), np.sin(turn)])).argmax(axis=0))]
    flat = convex_hull(map(tuple, np.round(corners, 4).tolist())).vertices
    return PrismShape(flat, float(turned[:, 2].min()), float(turned[:, 2].max()))


def matrix(quaternion: Array) -> Array:
    """(3, 3): the rotation of a unit quaternion (w, x, y, z)."""
    return np.stack([rotate(quaternion, axis) for axis in np.eye(3)], axis=1)


@contextmanager
def silence() -> Iterator[None]:
    """robosuite and LIBERO print as they are imported and made, and as they step."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            yield
    finally:
        logging.disable(before)


class LiveModel:
    """The MuJoCo model and data of an environment, which has been reset, by the names of its things.

    `things` are all of them with the number of their root body, `movers` those with a free joint, with the address of
    their pose in qpos, `parts` the joints of the others, the fixtures, whose poses in the world are `fixed` (7,);
    `start` is qpos as the reset left it.
    """

    def __init__(self, env: Any) -> None:
        need("mujoco", "for live environments")
        import mujoco

        self.mj: Any = mujoco
        self.env: Any = env.env if hasattr(getattr(env, "env", None), "parsed_problem") else env
        self.task = Path(str(getattr(self.env, "bddl_file_name", ""))).stem  # "" where it is not LIBERO's
        self.sim: Any = self.env.sim
        self.model: Any = self.sim.model._model
        self.data: Any = self.sim.data._data
        if hasattr(self.env, "parsed_problem"):
            self.things = {name: int(body) for name, body in self.env.obj_body_id.items()}
        else:
            models = self.env.model.mujoco_objects
            self.things = {one.name: int(self.sim.model.body_name2id(one.root_body)) for one in models}
        self.movers = {
            name: int(self.model.jnt_qposadr[self.model.body_jntadr[body]])
            for name, body in self.things.items()
            if self.model.body_jntadr[body] >= 0 and self.model.jnt_type[self.model.body_jntadr[body]] == 0
        }
        self.fixtures = [name for name in self.things if name not in self.movers]
        bodies = {name: self.things[name] for name in self.fixtures}
        self.fixed = {name: np.r_[self.model.body_pos[one], self.model.body_quat[one]] for name, one in bodies.items()}
        self.owners = self._owners()
        self.start: Array = self.data.qpos.copy()
        self.parts = self._parts()

    def _owners(self) -> list[str]:
        """By body: the thing, the robot, or nothing."""
        of_root = {body: name for name, body in self.things.items()}
        driven = {int(self.model.actuator_trnid[one][0]) for one in range(self.model.nu)}
        trees = {int(self.model.body_rootid[self.model.jnt_bodyid[one]]) for one in driven}
        found = [""] * self.model.nbody
        for body in range(1, self.model.nbody):
            robot = ROBOT_OWNER if int(self.model.body_rootid[body]) in trees else ""
            found[body] = of_root.get(body) or found[self.model.body_parentid[body]] or robot
        return found

    def owner(self, geom: int) -> str:
        return self.owners[int(self.model.geom_bodyid[geom])]

    def place(self, name: str, at: Sequence[float] | Array, attitude: Array) -> None:
        """Set the pose of a thing that moves."""
        address = self.movers[name]
        self.data.qpos[address : address + 7] = [*at, *attitude]

    def put_away(self) -> None:
        """Take all things that move out of the way."""
        for number, address in enumerate(self.movers.values()):
            self.data.qpos[address : address + 3] = (20.0 + number, 20.0, 1.0)

    @contextmanager
    def without_movers(self, joints: Mapping[str, float] | None = None) -> Iterator[None]:
        """As after the reset without the things that move, joints of fixtures set to some values."""
        before = self.data.qpos.copy()
        self.data.qpos[:] = self.start
        for name, value in (joints or {}).items():
            self.data.qpos[self.parts[name].address] = value
        self.put_away()
        self.mj.mj_forward(self.model, self.data)
        try:
            yield
        finally:
            self.data.qpos[:] = before
            self.mj.mj_forward(self.model, self.data)

    def stand(self, poses: Mapping[str, Array]) -> None:
        """Put fixtures at poses (7,) in the world, which are part of the model, not of a state."""
        for name, pose in poses.items():
            body = self.things[name]
            self.model.body_pos[body], self.model.body_quat[body] = pose[:3], pose[3:]

    def attitude(self, name: str) -> tuple[Array, float]:
        """How a thing stands after the reset: its quaternion (w, x, y, z) at heading 0, and its heading."""
        address = self.movers[name] + 3
        quaternion = self.start[address : address + 4]
        return upright(quaternion), float(heading_of(quaternion))

    def points(self, name: str, low: float = math.inf, *, drawn: bool = False) -> Array:
        """(n, 3): the corners of a thing's collision shapes, in the frame of its root body; of shapes that begin at
        most `low` above its lowest point. With `drawn`, also of what pictures show, which can be larger."""
        body = self.things[name]
        origin, turn = self.data.xpos[body], self.data.xmat[body].reshape(3, 3)
        geoms = (geom for geom in range(self.model.ngeom) if self.owner(geom) == name)
        model, shown = self.model, (DRAWN_GROUP,) if drawn else ()
        solid = [
            one
            for one in geoms
            if model.geom_contype[one] or model.geom_conaffinity[one] or model.geom_group[one] in shown
        ]
        found = [(self.corners(geom) - origin) @ turn for geom in solid]
        lowest = min((one[:, 2].min() for one in found), default=0.0)
        near = [one for one in found if one[:, 2].min() - lowest <= low]
        return np.concatenate(near) if near else np.zeros((0, 3))

    def corners(self, geom: int) -> Array:
        """(n, 3): points whose hull is a geom's, or a little larger."""
        kind, size, types = self.model.geom_type[geom], self.model.geom_size[geom], self.mj.mjtGeom
        if kind == types.mjGEOM_MESH:
            mesh = self.model.geom_dataid[geom]
            begin, count = self.model.mesh_vertadr[mesh], self.model.mesh_vertnum[mesh]
            corners = np.asarray(self.model.mesh_vert[begin : begin + count], dtype=np.float64)
        elif kind == types.mjGEOM_CYLINDER:
            turn = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
            ring = size[0] * np.stack([np.cos(turn), np.sin(turn)], axis=1)
            corners = np.concatenate([np.c_[ring, np.full(24, z)] for z in (-size[1], size[1])])
        else:
            middle, half = self.model.geom_aabb[geom].reshape(2, 3)
            corners = middle + half * np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
        turned: Array = corners @ self.data.geom_xmat[geom].reshape(3, 3).T + self.data.geom_xpos[geom]
        return turned

    def site(self, name: str) -> tuple[Array, Array, Array]:
        """Where the middle of a site is, its rotation (3, 3), and its own half sizes."""
        number = self.mj.mj_name2id(self.model, self.mj.mjtObj.mjOBJ_SITE, name)
        return self.data.site_xpos[number], self.data.site_xmat[number].reshape(3, 3), self.model.site_size[number]

    def ray(
        self, origin: Sequence[float] | Array, direction: Sequence[float] | Array, groups: Collection[int] = (0,)
    ) -> tuple[float, str]:
        """How far it is to the first shape of some groups, by default those that collide, and whose that is; infinite
        where there is none."""
        geom, asked = np.array([-1], dtype=np.int32), np.array([one in groups for one in range(6)], dtype=np.uint8)
        at, way = np.array(origin, dtype=np.float64), np.array(direction, dtype=np.float64)
        far = self.mj.mj_ray(self.model, self.data, at, way, asked, 1, -1, geom)
        return (math.inf, "") if geom[0] < 0 else (float(far), self.owner(int(geom[0])))

    def ground(self, origin: Sequence[float], reach: float = 0.3) -> float:
        """The height of the ground near a point, by rays past all things onto shapes that only collide; or else, as
        LIBERO's floor is, onto those that are drawn, too."""
        x, y, z = origin
        grid, above = np.linspace(-reach, reach, 7), z + 0.08
        for groups in ((0,), (DRAWN_GROUP,)):
            with self.without_movers():
                found = [self.ray((x + u, y + v, above), DOWNWARDS, groups) for u in grid for v in grid]
            heights = [above - far for far, owner in found if math.isfinite(far) and not owner]
            if heights:
                return float(np.median(heights))
        return z

    def floor(self, site: str, half: Array, fixture: str, joints: Mapping[str, float]) -> Floor:
        """The floor of a fixture at one of its sites, by rays from within it. A site on a slope, or that no ray finds a
        floor below, is its own floor."""
        with self.without_movers(joints):
            (x, y, z), turn, _ = self.site(site)
            size = np.abs(turn @ half)
            if np.abs(turn[2]).max() < UPRIGHT_COSINE:  # LIBERO takes what is up to 10 cm over it, along its own axis
                ends = np.array(
                    [(u, v, w) for u in (-half[0], half[0]) for v in (-half[1], half[1]) for w in (0.0, 0.1)]
                )
                low, high = (ends @ turn.T).min(axis=0).tolist(), (ends @ turn.T).max(axis=0).tolist()
                own = (x + low[0], y + low[1], x + high[0], y + high[1])
                return Floor(own, own, z)
            begin = z if size[2] > FLAT_SITE else z + 0.05
            hits = []
            for u, v in ((u, v) for u in RAY_GRID * size[0] for v in RAY_GRID * size[1]):
                far, owner = self.ray((x + u, y + v, begin), DOWNWARDS)
                if owner == fixture:
                    hits.append((u, v, begin - far))
            if not hits:
                own = (x - size[0], y - size[1], x + size[0], y + size[1])
                return Floor(own, own, float(z - size[2]))
            found = np.array(hits)
            height = float(np.median(found[:, 2]))
            on = found[np.abs(found[:, 2] - height) < FLOOR_TOLERANCE, :2]
            step = (RAY_GRID[1] - RAY_GRID[0]) / 2.0 * size[:2]
            left, bottom = np.maximum(on.min(axis=0) - step, -size[:2]).tolist()
            right, top = np.minimum(on.max(axis=0) + step, size[:2]).tolist()
            rectangle = (x + left, y + bottom, x + right, y + top)
            return Floor(rectangle, self._walls(rectangle, height, begin) if size[2] > FLAT_SITE else rectangle, height)

    def _walls(self, rectangle: Rectangle, floor: float, top: float, most: float = 0.3) -> Rectangle:
        """The rectangle up to the walls around a floor, at most 30 cm away, by rays from over its middle lines."""
        low, high = np.array(rectangle[:2]), np.array(rectangle[2:])
        middle, half = (low + high) / 2.0, (high - low) / 2.0
        found = []
        for axis, sign in ((0, -1.0), (1, -1.0), (0, 1.0), (1, 1.0)):
            direction = [sign * (axis == 0), sign * (axis == 1), 0.0]
            far = most
            for part in (-0.6, -0.3, 0.0, 0.3, 0.6):
                at = middle + part * half * (np.arange(2) != axis)
                for height in (floor + 0.01, (floor + max(top, floor + 0.02)) / 2.0):
                    far = min(far, self.ray((*at, height), direction)[0])
            found.append(float(middle[axis] + sign * far))
        return found[0], found[1], found[2], found[3]

    def _parts(self) -> dict[str, JointPart]:
        found = {}
        for joint in range(self.model.njnt):
            body = self.model.jnt_bodyid[joint]
            if self.owners[body] not in self.fixtures:
                continue
            lever = 1.0
            if self.model.jnt_type[joint] == self.mj.mjtJoint.mjJNT_HINGE:  # how far its shapes reach from the axis
                corners = [self.corners(one) for one in range(self.model.ngeom) if self.model.geom_bodyid[one] == body]
                arms = np.cross(
                    np.concatenate([np.zeros((0, 3)), *corners]) - self.data.xanchor[joint], self.data.xaxis[joint]
                )
                lever = round(max(float(np.linalg.norm(arms, axis=1).max(initial=0.0)), 0.01), 3)
            low, high = map(float, self.model.jnt_range[joint])
            name = self.mj.mj_id2name(self.model, self.mj.mjtObj.mjOBJ_JOINT, joint)
            found[name] = JointPart(name, int(self.model.jnt_qposadr[joint]), low, high, lever)
        return found

    def accepted_range(self, part: JointPart, holds: Callable[[float], bool]) -> tuple[float, float] | None:
        """The longest range of a joint that a predicate accepts, and in which the shapes of the fixture keep clear of
        one another; None where there is none."""
        grid = np.unique(np.concatenate([np.linspace(part.low, part.high, 401), np.linspace(-0.005, 0.005, 51)]))
        runs: list[list[float]] = [[]]
        with self.without_movers():
            for value in grid[(grid >= part.low) & (grid <= part.high)].tolist():
                self.data.qpos[part.address] = value
                self.mj.mj_fwdPosition(self.model, self.data)
                within = max((far for a, b, far in self.contacts() if a == b and a in self.fixtures), default=0.0)
                if holds(value) and within < 5e-4:
                    runs[-1].append(value)
                elif runs[-1]:
                    runs.append([])
        return max(((run[0], run[-1]) for run in runs if run), key=lambda run: run[1] - run[0], default=None)

    def contacts(self) -> Iterator[tuple[str, str, float]]:
        """Whose shapes touch, and how deep they are in each other."""
        for one in self.data.contact[: self.data.ncon]:
            yield self.owner(one.geom1), self.owner(one.geom2), -float(one.dist)

    def depth(self, names: Collection[str]) -> float:
        """The depth of the deepest contact of some things with others."""
        return max((far for a, b, far in self.contacts() if a != b and (a in names or b in names)), default=0.0)
