"""robosuite: its environments start from scenes of a spec.

    from scenegen.robosuite import Placement
    env = robosuite.make("Stack", robots="Panda", placement_initializer=Placement(spec, (-0.2, 0), reference_pos=...))

Nothing here imports robosuite: a placement works with the objects that the environment gives it.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

# name -> the module that defines it
_PUBLIC = {
    "InitStates": "scenegen.worlds.robosuite.placement",
    "Placement": "scenegen.worlds.robosuite.placement",
    "init_states": "scenegen.worlds.robosuite.placement",
    "phi_space": "scenegen.worlds.robosuite.starts",
}

__all__ = ["InitStates", "Placement", "init_states", "phi_space"]

if TYPE_CHECKING:
    from scenegen.worlds.robosuite.placement import InitStates, Placement, init_states
    from scenegen.worlds.robosuite.starts import phi_space


def __getattr__(name: str) -> Any:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'scenegen.robosuite' has no attribute {name!r}")
    value = getattr(importlib.import_module(_PUBLIC[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)
