"""Learning with the scenes: environments, and strategies that choose the next task.

If gymnasium is installed, importing this registers `scenegen/TableTop-v0` and `scenegen/Motion-v0` (gymnasium 1.0 has
no plugins, so an import is needed): `gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec=...)` does the
import.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from scenegen.curriculum.register import register_environments

# name -> the module that defines it
_PUBLIC = {
    "Curriculum": "scenegen.curriculum.wrapper",
    "CurriculumCallback": "scenegen.curriculum.sb3",
    "MotionTable": "scenegen.curriculum.motion_env",
    "MotionVector": "scenegen.curriculum.motion_vector",
    "Outcome": "scenegen.curriculum.tasks",
    "PhiBox": "scenegen.curriculum.tasks",
    "SB3Vector": "scenegen.curriculum.sb3_vector",
    "Strategy": "scenegen.curriculum.tasks",
    "TableTop": "scenegen.curriculum.env",
    "TableTopVector": "scenegen.curriculum.vector",
    "VectorCurriculum": "scenegen.curriculum.wrapper",
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
    from scenegen.curriculum.env import TableTop
    from scenegen.curriculum.motion_env import MotionTable
    from scenegen.curriculum.motion_vector import MotionVector
    from scenegen.curriculum.sb3 import CurriculumCallback
    from scenegen.curriculum.sb3_vector import SB3Vector
    from scenegen.curriculum.tasks import Outcome, PhiBox, Strategy
    from scenegen.curriculum.vector import TableTopVector
    from scenegen.curriculum.wrapper import Curriculum, VectorCurriculum


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'scenegen.curriculum' has no attribute {name!r}")
    value = getattr(importlib.import_module(_PUBLIC[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


register_environments()
