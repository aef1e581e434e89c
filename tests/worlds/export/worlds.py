"""Scene sets made by hand, for simulators: every object of the library in a grid, a tower, a thing held in place."""

import math

import numpy as np

from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet
from scenegen.lang.checker import check_text
from scenegen.scenes.data import RequestData
from scenegen.things import ASSETS
from scenegen.worlds.export.world import world_of


def scenes_of(text, *poses):
    """Scenes of a spec; each is a dict from names to (x, y, theta), in the spec's order."""
    spec = check_text(text, "made.spec")
    header = make_header(spec, {"method": "made"}, RequestData(phi={}, n=max(len(poses), 1)))
    rows = np.array([[scene[name] for name in spec.objects] for scene in poses], dtype=np.float64)
    phi = {label: np.zeros(len(poses)) for label in spec.labels}
    return SceneSet(rows.reshape(len(poses), len(spec.objects), 3), phi, header, trusted=True)


def library():
    """Every asset once, half a metre apart, each with a heading of its own."""
    names = list(ASSETS)
    side = math.ceil(math.sqrt(len(names)))
    text = f"workspace [0, {side}] x [0, {side}]\nobject {', '.join(names)}\ntask: leftOf({names[0]}, {names[1]})"
    places = {name: (0.5 + k % side / 2, 0.5 + k // side / 2, 0.2 * k) for k, name in enumerate(names)}
    return scenes_of(text, places)


TOWER = """object plate, mug, block[2]
object tray = box(0.3, 0.2, 0.02) at (0.7, 0.7, 0.5)
region mat = rect(0, 0, 0.5, 0.4)
region spot = circle((0.8, 0.3), 0.1)
task: leftOf(mug, tray)
"""


def tower():
    """Two scenes: a mug on a plate and a block on a block, then all on the table; a fixed tray with a block on it."""
    tray = (0.7, 0.7, 0.5)
    carried = {
        "plate": (0.3, 0.3, 1.0),
        "mug": (0.3, 0.3, 2.0),
        "block[1]": (0.7, 0.7, 0.1),
        "block[2]": (0.7, 0.7, 4.0),
    }
    apart = {"plate": (0.3, 0.3, 6.0), "mug": (0.6, 0.2, 3.5), "block[1]": (0.1, 0.7, 0.1), "block[2]": (0.3, 0.9, 0.0)}
    return scenes_of(TOWER, carried | {"tray": tray}, apart | {"tray": tray})


def crates():
    """Two scenes of boxes, one of them fixed and one on it, and a region."""
    text = """# Crates on a mat.
workspace [0, 0.5] x [0, 0.5]
object crate[2] = box(0.08, 0.06, 0.04)
object base = box(0.16, 0.16, 0.02) at (0.25, 0.125, 0)
region mat = rect(0, 0, 0.5, 0.25)
task: leftOf(crate[1], crate[2])
"""
    base = {"base": (0.25, 0.125, 0.0)}
    on = {"crate[1]": (0.25, 0.125, 0.0), "crate[2]": (0.375, 0.375, 0.0)}
    off = {"crate[1]": (0.125, 0.375, 0.0), "crate[2]": (0.375, 0.375, 0.0)}
    return scenes_of(text, on | base, off | base)


def world(scenes):
    """What simulators get of them."""
    (block,) = scenes.blocks()
    return world_of(scenes.header, block)
