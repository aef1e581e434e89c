"""The robots of a live environment as statements of a spec: where the base of each arm stands."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from scenegen.play.frame import heading_of
from scenegen.play.libero.measure import LiveModel
from scenegen.things.arms import shipped_arm, shipped_arms

GROUND_TOLERANCE = 0.001  # metres by which a base may be over the ground and count as on it


def robot_statements(live: LiveModel, origin: Sequence[float], taken: Collection[str]) -> list[str]:
    """Statements of a spec whose (0, 0) is at `origin` on the ground, for each robot whose arm comes along, by the name
    of its model; of one that stands higher, the board under it too. Names that are `taken` get a `_`. A spec has
    nothing lower than the ground: of a robot that stands there, and of one that is no known arm, a comment says so."""
    found, names = [], {*taken}
    for robot in getattr(live.env, "robots", ()):
        model = robot.robot_model
        kind = next((one for one in shipped_arms() if type(model).__name__.lower().endswith(one)), None)
        body = int(live.sim.model.body_name2id(model.root_body))
        x, y, z = (live.data.xpos[body] - origin).tolist()
        if kind is None or z < -GROUND_TOLERANCE:
            why = "is no arm that comes along" if kind is None else "stands lower than the ground"
            found.append(f"# The robot {type(model).__name__} is left out: it {why}.")
            continue
        name = "arm"
        while name in names:
            name += "_"
        names.add(name)
        heading, place = float(heading_of(live.data.xquat[body])) % (2.0 * math.pi), ""
        if z > GROUND_TOLERANCE:
            base = shipped_arm(kind).base
            half = math.hypot(base.width, base.depth) / 2.0
            box = ", ".join(f"{one:.6g}" for one in (x - half, y - half, x + half, y + half))
            found.append(f"region {name}_mount = rect({box}) at {z:.6g} m")
            place = f" on {name}_mount"
        at = ", ".join(f"{round(one, 6) + 0.0:.10g}" for one in (x, y, heading))
        found.append(f"robot {name} = {kind}{place} at ({at} rad)")
    return found
