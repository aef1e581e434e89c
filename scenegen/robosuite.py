"""robosuite: its environments start from scenes of a spec. The door of `scenegen.worlds.robosuite`."""

from typing import TYPE_CHECKING

from scenegen.worlds.robosuite import __all__ as __all__
from scenegen.worlds.robosuite import __dir__ as __dir__
from scenegen.worlds.robosuite import __getattr__ as __getattr__

if TYPE_CHECKING:
    from scenegen.worlds.robosuite import *  # noqa: F403
