"""Experiment 1's spec by hand: task = min(x(plate) - x(mug), y(mug) - y(plate)), safe = dist(mug, plate) - 0.25."""

from scenegen.lang.core import Apply, Atom, Const, Coord, Core, Junction
from scenegen.lang.spec import CheckedSpec
from scenegen.primitives import LENGTH
from scenegen.scene.workspace import Workspace


def exp1_spec(workspace=None, closeness=0.25, name="exp1.spec"):
    nodes = (
        Coord(0, 0),
        Coord(1, 0),
        Coord(0, 1),
        Coord(1, 1),
        Apply("sub", (1, 0)),
        Atom(4, "leftOf(mug, plate)", LENGTH, ()),
        Apply("sub", (2, 3)),
        Atom(6, "aboveOf(mug, plate)", LENGTH, ()),
        Junction("min", (5, 7)),
        Apply("dist", (0, 2, 1, 3)),
        Const(closeness),
        Apply("sub", (9, 10)),
        Atom(11, "!closeTo(mug, plate)", LENGTH, ()),
    )
    source = f"task: leftOf(mug, plate) & aboveOf(mug, plate)\nsafe: !closeTo(mug, plate, {closeness})\n"
    core = Core(nodes, {"task": 8, "safe": 12}, ("mug", "plate"))
    return CheckedSpec(name, source, workspace or Workspace(), core)
