"""Start layouts for simulators that run many environments at once: tensors (B, N, 7).

from scenegen.layouts import Layouts
layouts = Layouts(spec, (0, None), quaternion="wxyz", device="cuda")
poses, phi = layouts.take(len(env_ids))
"""

from scenegen.play.layouts import Layouts, Taken

__all__ = ["Layouts", "Taken"]
