"""Start layouts for simulators that run many environments at once. The door of `scenegen.worlds.layouts`."""

from typing import TYPE_CHECKING

from scenegen.worlds.layouts import __all__ as __all__
from scenegen.worlds.layouts import __dir__ as __dir__
from scenegen.worlds.layouts import __getattr__ as __getattr__

if TYPE_CHECKING:
    from scenegen.worlds.layouts import *  # noqa: F403
