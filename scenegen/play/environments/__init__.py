"""Learning with the scenes: environments, and strategies that choose the next task.

If gymnasium is installed, importing this registers `scenegen/TableTop-v0` (gymnasium 1.0 has no plugins, so an import
is needed): `gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec=...)` does the import.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from scenegen.play.tasks import ENVIRONMENT_ID

EPISODE_STEPS = 100  # of an episode, unless given as `gymnasium.make(..., max_episode_steps=)`

# name -> the module that defines it
_MODULE_OF = {
    "Curriculum": "scenegen.play.environments.wrapper",
    "CurriculumCallback": "scenegen.play.environments.sb3",
    "Outcome": "scenegen.play.tasks",
    "PhiBox": "scenegen.play.tasks",
    "SB3Vector": "scenegen.play.environments.sb3",
    "Strategy": "scenegen.play.tasks",
    "TableTop": "scenegen.play.environments.tabletop",
    "TableTopVector": "scenegen.play.environments.tabletop",
    "VectorCurriculum": "scenegen.play.environments.wrapper",
}

__all__ = [
    "Curriculum",
    "CurriculumCallback",
    "Outcome",
    "PhiBox",
    "SB3Vector",
    "Strategy",
    "TableTop",
    "TableTopVector",
    "VectorCurriculum",
]

if TYPE_CHECKING:
    from scenegen.play.environments.sb3 import CurriculumCallback, SB3Vector
    from scenegen.play.environments.tabletop import TableTop, TableTopVector
    from scenegen.play.environments.wrapper import Curriculum, VectorCurriculum
    from scenegen.play.tasks import Outcome, PhiBox, Strategy


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'scenegen.curriculum' has no attribute {name!r}")
    value = getattr(importlib.import_module(_MODULE_OF[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)


def register_environment() -> None:
    """Make the environment known to gymnasium, once; does nothing if it is not installed."""
    try:
        import gymnasium
    except ImportError:  # strategies do not need gymnasium
        return
    if ENVIRONMENT_ID in gymnasium.registry:
        return
    gymnasium.register(
        id=ENVIRONMENT_ID,
        entry_point="scenegen.play.environments.tabletop:TableTop",
        vector_entry_point="scenegen.play.environments.tabletop:TableTopVector",
        max_episode_steps=EPISODE_STEPS,
    )


register_environment()
