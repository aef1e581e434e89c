"""Learning with the scenes: environments, and strategies that choose the next task. The door of
`scenegen.learn.curriculum`."""

from typing import TYPE_CHECKING

from scenegen.learn.curriculum import __all__ as __all__
from scenegen.learn.curriculum import __dir__ as __dir__
from scenegen.learn.curriculum import __getattr__ as __getattr__

if TYPE_CHECKING:
    from scenegen.learn.curriculum import *  # noqa: F403
