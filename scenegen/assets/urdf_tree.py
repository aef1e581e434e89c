"""The links of a URDF file with their poses, all joints at zero, and the numbers of its elements.

The format: http://wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenegen.assets.elements import Element
from scenegen.assets.mesh import Floats

FARTHEST = 1e6  # of any number in the file
KINDS = ("box", "cylinder", "sphere", "mesh")


class UrdfError(Exception):
    """The file is of no use; the text says why."""


@dataclass(frozen=True, slots=True)
class Pose:
    """A frame: `turn` (3, 3) its axes, `at` (3,) its origin, in the frame of the root link."""

    turn: Floats
    at: Floats

    def then(self, inner: Pose) -> Pose:
        return Pose(self.turn @ inner.turn, self.turn @ inner.at + self.at)


def links_of(robot: Element) -> list[tuple[Element, Pose]]:
    """Every link with its pose, all joints at zero. Raises UrdfError."""
    if robot.tag != "robot":
        raise UrdfError(f"its outermost element is <{robot.tag}>, a URDF's is <robot>")
    links: dict[str, Element] = {}
    for link in robot.all("link"):
        name = link.get("name")
        if name in links:
            raise UrdfError(f"{link.place}: a second link `{name}`")
        links[name] = link
    if not links:
        raise UrdfError("it has no link")
    below: dict[str, list[tuple[str, Pose]]] = {}
    parents: dict[str, str] = {}
    for joint in robot.all("joint"):
        ends = []
        for role in ("parent", "child"):
            end = joint.one(role)
            name = end.get("link")
            if name not in links:
                raise UrdfError(f"{end.place}: there is no link `{name}`")
            ends.append(name)
        parent, child = ends
        if child in parents:
            raise UrdfError(f"{joint.place}: link `{child}` has two parents, `{parents[child]}` and `{parent}`")
        parents[child] = parent
        below.setdefault(parent, []).append((child, origin_of(joint)))
    roots = [name for name in links if name not in parents]
    if len(roots) > 1:
        raise UrdfError(f"its links do not hang together: no joint moves `{roots[0]}` and none `{roots[1]}`")
    found = [(name, Pose(np.eye(3), np.zeros(3))) for name in roots]
    for name, pose in found:  # grows while it is walked
        found += [(child, pose.then(origin)) for child, origin in below.get(name, [])]
    if len(found) < len(links):
        lost = next(name for name in links if name not in dict(found))
        raise UrdfError(f"its joints run in a circle through link `{lost}`")
    return [(links[name], pose) for name, pose in found]


def origin_of(element: Element) -> Pose:
    """The pose that an element's <origin> gives: `rpy` are turns about the fixed x, y and z axes, in that order."""
    origins = element.all("origin")
    if not origins:
        return Pose(np.eye(3), np.zeros(3))
    roll, pitch, yaw = numbers_of(origins[0], "rpy", 3, "0 0 0")
    (cr, sr), (cp, sp), (cy, sy) = ((math.cos(angle), math.sin(angle)) for angle in (roll, pitch, yaw))
    turn = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    return Pose(turn, np.array(numbers_of(origins[0], "xyz", 3, "0 0 0")))


def solid_of(shape: Element) -> Element:
    """The box, cylinder, sphere or mesh of a <visual> or <collision>. Raises UrdfError."""
    geometry = shape.one("geometry")
    if len(geometry.children) != 1 or geometry.children[0].tag not in KINDS:
        found = " and ".join(f"<{child.tag}>" for child in geometry.children[:3]) or "nothing"
        raise UrdfError(f"{geometry.place}: a shape is one box, cylinder, sphere or mesh; here is {found}")
    return geometry.children[0]


def numbers_of(element: Element, name: str, count: int, default: str = "") -> list[float]:
    text = element.get(name, default)
    try:
        values = [float(word) for word in text.split() if "_" not in word]
    except ValueError:
        values = []
    if len(values) != count or len(text.split()) != count:
        wanted = "a number" if count == 1 else f"{count} numbers"
        raise UrdfError(f'{element.place}: {name}="{text[:40]}" is not {wanted}')
    if not all(abs(value) <= FARTHEST for value in values):  # nor nan
        raise UrdfError(f'{element.place}: {name}="{text[:40]}" is beyond all measure')
    return values


def sizes_of(element: Element, name: str, count: int) -> list[float]:
    values = numbers_of(element, name, count)
    if min(values) < 0.0:
        raise UrdfError(f'{element.place}: {name}="{element.get(name)[:40]}" is negative')
    return values
