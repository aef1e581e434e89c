"""Learning with the scenes: environments, and strategies that choose the next task.

If gymnasium is installed, importing this registers `scenegen/TableTop-v0` and `scenegen/Motion-v0` (gymnasium 1.0 has
no plugins, so an import is needed): `gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec=...)` does the
import.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from scenegen.learn.curriculum.tasks import ID, MOTION_ID

MAX_STEPS = 100  # of an episode, unless given as `gymnasium.make(..., max_episode_steps=)`

# name -> the module that defines it
_PUBLIC = {
    "Curriculum": "scenegen.learn.curriculum.wrapper",
    "CurriculumCallback": "scenegen.learn.curriculum.sb3",
    "MotionTable": "scenegen.learn.curriculum.motion",
    "MotionVector": "scenegen.learn.curriculum.motion",
    "Outcome": "scenegen.learn.curriculum.tasks",
    "PhiBox": "scenegen.learn.curriculum.tasks",
    "SB3Vector": "scenegen.learn.curriculum.sb3",
    "Strategy": "scenegen.learn.curriculum.tasks",
    "TableTop": "scenegen.learn.curriculum.tabletop",
    "TableTopVector": "scenegen.learn.curriculum.tabletop",
    "VectorCurriculum": "scenegen.learn.curriculum.wrapper",
}

__all__ = [
    "Curriculum",
    "CurriculumCallback",
    "MotionTable",
    "MotionVector",
    "Outcome",
    "PhiBox",
    "SB3Vector",
    "Strategy",
    "TableTop",
    "TableTopVector",
    "VectorCurriculum",
]

if TYPE_CHECKING:
    from scenegen.learn.curriculum.motion import MotionTable, MotionVector
    from scenegen.learn.curriculum.sb3 import CurriculumCallback, SB3Vector
    from scenegen.learn.curriculum.tabletop import TableTop, TableTopVector
    from scenegen.learn.curriculum.tasks import Outcome, PhiBox, Strategy
    from scenegen.learn.curriculum.wrapper import Curriculum, VectorCurriculum


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'scenegen.curriculum' has no attribute {name!r}")
    value = getattr(importlib.import_module(_PUBLIC[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


def register_environments() -> None:
    """Make both environments known to gymnasium, once; does nothing if it is not installed."""
    try:
        import gymnasium
    except ImportError:  # strategies do not need gymnasium
        return
    if ID in gymnasium.registry:
        return
    gymnasium.register(
        id=ID,
        entry_point="scenegen.learn.curriculum.tabletop:TableTop",
        vector_entry_point="scenegen.learn.curriculum.tabletop:TableTopVector",
        max_episode_steps=MAX_STEPS,
    )
    # its episodes end with the spec's horizon, so there is no limit of steps
    gymnasium.register(
        id=MOTION_ID,
        entry_point="scenegen.learn.curriculum.motion:MotionTable",
        vector_entry_point="scenegen.learn.curriculum.motion:MotionVector",
    )


register_environments()
