"""The pictures of `render()`, by scenegen's own renderer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.scene_arrays import make_header, stored_rows
from scenegen.api.scenes import SceneSet
from scenegen.arrays import Array
from scenegen.errors.requests import UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.lang.spec import CheckedSpec
from scenegen.needs import need
from scenegen.play.environments.gym_errors import as_gym_errors, gym_error
from scenegen.pose import as_poses, row_count
from scenegen.scenes.data import RequestData, SceneFile, heights_of, varying

if TYPE_CHECKING:
    from scenegen.pictures.render.worker import LiveRenderer

RENDER_MODES = ("rgb_array",)


class SceneRenderer:
    """Draws scenes of a spec, one at a time. Raises gymnasium.error.UnsupportedMode for an unknown mode, and Error for
    an invalid view or size, and if pybullet is not installed."""

    def __init__(self, mode: str | None, view: str, size: tuple[int, int]) -> None:
        if mode is not None and mode not in RENDER_MODES:
            unknown = UNKNOWN_CHOICE(what="render mode", name=str(mode), known=RENDER_MODES)
            raise gym_error(unknown, error.UnsupportedMode)
        if not isinstance(view, str):
            raise gym_error(WRONG_VALUE(argument="view", value=repr(view), wanted="the name of a view"))
        sides = size if isinstance(size, tuple | list) else ()
        if len(sides) != 2 or not all(isinstance(side, int | np.integer) for side in sides):
            wanted = "(width, height) in whole pixels"
            raise gym_error(WRONG_VALUE(argument="size", value=repr(size), wanted=wanted))
        if mode is not None:
            from scenegen.pictures.render.worker import check_request

            with as_gym_errors():
                check_request((view,), size, None)
                need("pybullet", "to draw pictures")
        self.mode, self._look = mode, (view, size)
        self._live: LiveRenderer | None = None
        self._header: SceneFile | None = None

    def draw(self, spec: CheckedSpec, row: Array) -> npt.NDArray[np.uint8]:
        """A scene (3N,) as (height, width, 3). The first one determines how high the camera looks."""
        from scenegen.pictures.render.worker import LiveRenderer

        rows = row_count(len(spec.objects))
        poses, on = as_poses(row[:rows]), stored_rows(spec, row[:, None])[rows:].T
        with as_gym_errors():
            if self._live is None:
                header = make_header(spec, {"method": "environment"}, RequestData(phi={}, n=1, spread="base"))
                self._header = header
                shown = SceneSet(poses[None], {}, header, on=on if spec.choices else None).file()
                self._live = LiveRenderer(shown, *self._look)
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
