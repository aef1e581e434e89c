"""Learning with the scenes: environments, and strategies that choose the next task. The door of
`scenegen.play.environments`."""

from typing import TYPE_CHECKING

from scenegen.play.environments import __all__ as __all__
from scenegen.play.environments import __dir__ as __dir__
from scenegen.play.environments import __getattr__ as __getattr__

if TYPE_CHECKING:
    from scenegen.play.environments import *  # noqa: F403
