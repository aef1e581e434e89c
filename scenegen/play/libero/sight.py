"""What a camera of a live environment sees: its place, and the shares of things, by rays onto what is drawn."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.play.libero.measure import DRAWN_GROUP, LiveModel

AGENT_VIEW = "agentview"  # LIBERO's camera, from which policies see the table; its pictures are square
ALONE_GROUP = 5  # of geoms: where a thing is put to be looked at by itself
LEVEL_SINE = 0.01  # the sine of the largest angle by which a level picture may be turned
PICTURE_PIXELS = 256  # from side to side of the picture whose pixels are counted, by a ray through the middle of each
MOST_PIXELS = 80  # of them from side to side of a thing; where it has more, every second counts, or fewer


def still_cameras(live: LiveModel) -> list[LiveCamera]:
    """Those that stand still in the world, with level pictures and a name of letters, digits and `_`."""
    still = [one for one in range(live.model.ncam) if not live.model.cam_bodyid[one] and not live.model.cam_mode[one]]
    names = [str(live.model.camera(one).name) for one in still]
    return [one for one in (LiveCamera(live, name) for name in names if name.isidentifier()) if one.is_level]


class LiveCamera:
    """A camera of an environment that does not move: `eye` (3,) in the world, in metres; `turn` (3, 3), whose columns
    point to the right, up and back; `field`, the angle of the picture's height, in degrees. Raises RequestError."""

    def __init__(self, live: LiveModel, name: str = AGENT_VIEW) -> None:
        number = live.mj.mj_name2id(live.model, live.mj.mjtObj.mjOBJ_CAMERA, name)
        if number < 0:
            known = [str(live.model.camera(one).name) for one in range(live.model.ncam)]
            raise RequestError(UNKNOWN_CHOICE(what="camera", name=name, known=known))
        self.name, self.live, self.field = name, live, float(live.model.cam_fovy[number])
        self.eye: Array = live.data.cam_xpos[number].copy()
        self.turn: Array = live.data.cam_xmat[number].reshape(3, 3).copy()

    def statement(self, origin: Sequence[float]) -> str:
        """The statement of a spec whose (0, 0) is at `origin` on the ground: it looks at a point of the ground where it
        looks down."""
        x, y, z = (self.eye - origin).tolist()
        ahead = -self.turn[:, 2]
        a, b, c = (np.array([x, y, z]) + ahead * (z / -ahead[2] if ahead[2] < -0.1 else 1.0)).tolist()
        eye, target = (", ".join(f"{round(one, 6) + 0.0:.10g}" for one in point) for point in ((x, y, z), (a, b, c)))
        return f"camera {self.name} = at ({eye}) looks at ({target}) fov {self.field:.10g} deg, 1:1"

    def visible_share(self, name: str) -> float:
        """The share of a thing's silhouette that the camera sees: the rest is behind something, such as the robot, or
        beyond the edge of the picture."""
        live, edge = self.live, math.tan(math.radians(self.field) / 2.0)
        drawn = [one for one in range(live.model.ngeom) if live.model.geom_group[one] == DRAWN_GROUP]
        own = [one for one in drawn if live.owner(one) == name]
        points = (np.concatenate([live.corners(one) for one in own]) - self.eye) @ self.turn
        slopes = points[:, :2] / -points[:, 2:]
        pixels = (slopes / edge + 1.0) * PICTURE_PIXELS / 2.0
        low, high = np.floor(pixels.min(axis=0)).astype(int), np.ceil(pixels.max(axis=0)).astype(int)
        step = 1 + int((high - low).max()) // MOST_PIXELS
        columns, rows = (np.arange(low[axis], high[axis], step) + 0.5 for axis in (0, 1))
        across, up = np.meshgrid(*((2.0 * one / PICTURE_PIXELS - 1.0) * edge for one in (columns, rows)))
        rays = np.stack([across.ravel(), up.ravel(), np.full(across.size, -1.0)], axis=1)
        pictured = (np.abs(rays[:, :2]) <= edge).all(axis=1)
        rays = rays @ self.turn.T
        with self._by_itself(own):
            alone = np.array([live.ray(self.eye, ray, (ALONE_GROUP,))[1] == name for ray in rays])
            groups = DRAWN_GROUP, ALONE_GROUP
            seen = [live.ray(self.eye, ray, groups)[1] == name for ray in rays[alone & pictured]]
        return sum(seen) / max(int(alone.sum()), 1)

    @property
    def is_level(self) -> bool:
        """Whether a spec has its picture: the sides are upright, or, where it looks straight down, y is up."""
        right, up, back = self.turn.T
        return bool(
            abs(right[2]) < LEVEL_SINE and (up[1] > 1.0 - LEVEL_SINE if back[2] > 1.0 - LEVEL_SINE else up[2] > 0.0)
        )

    @contextmanager
    def _by_itself(self, geoms: Sequence[int]) -> Iterator[None]:
        """The shapes of a thing are in a group of their own meanwhile."""
        self.live.model.geom_group[geoms] = ALONE_GROUP
        try:
            yield
        finally:
            self.live.model.geom_group[geoms] = DRAWN_GROUP
