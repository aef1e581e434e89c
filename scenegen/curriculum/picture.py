"""The pictures of `render()`, by scenegen's own renderer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.scene_arrays import make_header, stored_rows
from scenegen.api.scenes import SceneSet
from scenegen.curriculum.errors import as_gymnasium, refused
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.lang.spec import CheckedSpec
from scenegen.needs import need
from scenegen.pose import as_poses, row_count
from scenegen.scene.data import RequestData, SceneFile
from scenegen.scene.standing import heights_of, varying

if TYPE_CHECKING:
    from scenegen.render.live import Live

MODES = ("rgb_array",)


def check_render(mode: str | None, view: str, size: tuple[int, int]) -> None:
    """Raises gymnasium.error.UnsupportedMode for an unknown mode, and Error for an invalid view or size, and if
    pybullet is not installed."""
    if mode is not None and mode not in MODES:
        raise refused(UNKNOWN_CHOICE(what="render mode", name=str(mode), known=MODES), error.UnsupportedMode)
    if not isinstance(view, str):
        raise refused(WRONG_VALUE(argument="view", value=repr(view), wanted="the name of a view"))
    sides = size if isinstance(size, tuple | list) else ()
    if len(sides) != 2 or not all(isinstance(side, int | np.integer) for side in sides):
        wanted = "(width, height) in whole pixels"
        raise refused(WRONG_VALUE(argument="size", value=repr(size), wanted=wanted))
    if mode is not None:
        from scenegen.render.live import check_request

        with as_gymnasium():
            check_request((view,), size, None)
            need("pybullet", "to draw pictures")


class Easel:
    """Draws scenes of a spec, one at a time."""

    def __init__(self, spec: CheckedSpec, view: str, size: tuple[int, int]) -> None:
        self._spec, self._look = spec, (view, size)
        self._live: Live | None = None
        self._header: SceneFile | None = None

    def draw(self, row: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
        """A scene (3N,) as (height, width, 3). The first one determines how high the camera looks."""
        from scenegen.render.live import Live

        count = row_count(len(self._spec.objects))
        poses, on = as_poses(row[:count]), stored_rows(self._spec, row[:, None])[count:].T
        with as_gymnasium():
            if self._live is None:
                header = make_header(self._spec, {"method": "environment"}, RequestData(phi={}, n=1, spread="base"))
                self._header = header
                shown = SceneSet(poses[None], {}, header, on=on if self._spec.choices else None).file()
                self._live = Live(shown, *self._look)
            if self._header is not None and varying(self._header):
                heights = heights_of(self._header, on)
                assert heights is not None
                poses = np.concatenate([poses, heights[0][:, None]], axis=1)
            return self._live.draw(poses)

    def close(self) -> None:
        """End the process that draws."""
        if self._live is not None:
            self._live.close()
            self._live = None
