"""What `render()` shows, by scenegen's own renderer."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from gymnasium import error

from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.curriculum.faults import as_gymnasium
from scenegen.lang.spec import CheckedSpec
from scenegen.needs import need
from scenegen.scene.data import RequestData

if TYPE_CHECKING:
    from scenegen.render.live import Live

MODES = ("rgb_array",)


def check_render(mode: str | None, view: str, size: tuple[int, int]) -> None:
    """Raises gymnasium.error.UnsupportedMode for a mode, and Error for a view or a size, and where pybullet is not
    installed."""
    if mode is not None and mode not in MODES:
        raise error.UnsupportedMode(f'there is no render mode "{mode}"; it is "rgb_array" or None')
    if not isinstance(view, str):
        raise error.Error(f"`view` is {view!r}; it has to be the name of a view")
    sides = size if isinstance(size, tuple | list) else ()
    if len(sides) != 2 or not all(isinstance(side, int | np.integer) for side in sides):
        raise error.Error(f"`size` is {size!r}; write (width, height) in whole pixels")
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

    def draw(self, row: npt.NDArray[np.float64]) -> npt.NDArray[np.uint8]:
        """A scene (3N,) as (height, width, 3). The first one decides how high the camera looks."""
        from scenegen.render.live import Live

        poses = row.reshape(-1, 3)
        with as_gymnasium():
            if self._live is None:
                header = make_header(self._spec, {"method": "environment"}, RequestData(phi={}, n=1, spread="base"))
                shown = SceneSet(poses[None], {}, header).file()
                self._live = Live(shown, *self._look)
            return self._live.draw(poses)

    def close(self) -> None:
        """End the process that draws."""
        if self._live is not None:
            self._live.close()
            self._live = None
