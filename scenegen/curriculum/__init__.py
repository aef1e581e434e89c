"""Learning with the scenes: environments, and strategies that choose the next task.

If gymnasium is installed, importing this registers `scenegen/TableTop-v0` and `scenegen/Motion-v0` (gymnasium 1.0 has
no plugins, so an import is needed): `gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec=...)` does the
import.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from scenegen.curriculum.register import register_environments

# name -> the module of this package that defines it
_PUBLIC = {
    "Curriculum": "wrapper",
    "CurriculumCallback": "sb3",
    "MotionTable": "motion_env",
    "MotionVector": "motion_vector",
    "Outcome": "tasks",
    "PhiBox": "tasks",
    "SB3Vector": "sb3_vector",
    "Strategy": "tasks",
    "TableTop": "env",
    "TableTopVector": "vector",
    "VectorCurriculum": "wrapper",
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
    value = getattr(importlib.import_module(f"scenegen.curriculum.{_PUBLIC[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


register_environments()
