"""robosuite: its environments start from scenes of a spec.

    from scenegen.robosuite import Placement
    env = robosuite.make("Stack", robots="Panda", placement_initializer=Placement(spec, (-0.2, 0), reference_pos=...))

Nothing here imports robosuite: a placement works with the objects that the environment gives it.
"""

from scenegen.play.robosuite import Placement
from scenegen.play.starts import phi_space

__all__ = ["Placement", "phi_space"]
