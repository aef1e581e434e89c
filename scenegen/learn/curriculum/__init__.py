"""Learning with the scenes: environments, and strategies that choose the next task.

If gymnasium is installed, importing this registers `scenegen/TableTop-v0` and `scenegen/Motion-v0` (gymnasium 1.0 has
no plugins, so an import is needed): `gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec=...)` does the
import.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from scenegen.learn.curriculum.register import register_environments

# name -> the module that defines it
_PUBLIC = {
    "Curriculum": "scenegen.learn.curriculum.wrapper",
    "CurriculumCallback": "scenegen.learn.curriculum.sb3",
    "MotionTable": "scenegen.learn.curriculum.motion_env",
    "MotionVector": "scenegen.learn.curriculum.motion_vector",
    "Outcome": "scenegen.learn.curriculum.tasks",
    "PhiBox": "scenegen.learn.curriculum.tasks",
    "SB3Vector": "scenegen.learn.curriculum.sb3_vector",
    "Strategy": "scenegen.learn.curriculum.tasks",
    "TableTop": "scenegen.learn.curriculum.env",
    "TableTopVector": "scenegen.learn.curriculum.vector",
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
    from scenegen.learn.curriculum.env import TableTop
    from scenegen.learn.curriculum.motion_env import MotionTable
    from scenegen.learn.curriculum.motion_vector import MotionVector
    from scenegen.learn.curriculum.sb3 import CurriculumCallback
    from scenegen.learn.curriculum.sb3_vector import SB3Vector
    from scenegen.learn.curriculum.tasks import Outcome, PhiBox, Strategy
    from scenegen.learn.curriculum.vector import TableTopVector
    from scenegen.learn.curriculum.wrapper import Curriculum, VectorCurriculum


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'scenegen.curriculum' has no attribute {name!r}")
    value = getattr(importlib.import_module(_PUBLIC[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


register_environments()
