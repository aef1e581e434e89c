"""The chain of joints of a URDF file from its base to the tip of its hand, and where its links are at many postures at
once."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenegen.things.outline import Floats, MeshError
from scenegen.things.urdf import Element, LinkFrame, elements, links_of, numbers_of, origin_of

HINGES = ("revolute", "continuous")
MAX_CHAIN_JOINTS = 12  # joints that move between base and tip


class ChainError(MeshError):
    """A URDF file has no arm whose reach is understood: the text says why, `remedy` what to do."""

    def __init__(self, reason: str, remedy: str) -> None:
        super().__init__(reason)
        self.remedy = remedy


@dataclass(frozen=True, slots=True, eq=False)
class Hinge:
    """A joint that turns: its frame at angle 0 in the frame of the hinge before it (the first: of the base link), its
    unit `axis` (3,) in its own frame, and its limits in radians, infinite where it has none."""

    name: str
    frame: LinkFrame
    axis: Floats
    low: float
    high: float

    @property
    def span(self) -> float:
        return self.high - self.low

    @property
    def limits(self) -> tuple[float, float]:
        """The angles that differ by more than whole turns: all of them where it turns that far."""
        return (-math.pi, math.pi) if self.span >= math.tau else (self.low, self.high)


@dataclass(frozen=True, slots=True, eq=False)
class JointChain:
    """Hinges from the link `base` outwards, and `tip`, the frame of the tip link in that of the last hinge, which moves
    the link `last`."""

    base: str
    hinges: tuple[Hinge, ...]
    last: str
    tip: LinkFrame


def read_chain(data: bytes, tip: str, base: str = "") -> JointChain:
    """The chain from link `base` (the root, if empty) to link `tip` of a URDF file. Limits are those of <limit>, and of
    <safety_controller> where that is narrower. Raises MeshError, with line and element where there is one."""
    robot = elements(data)
    names = [link.get("name") for link, _ in links_of(robot)]
    for wanted in (tip, base or names[0]):
        if wanted not in names:
            raise ChainError(f"it has no link `{wanted[:60]}`", f"its links are {_name_some(names)}")
    above = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}
    steps: list[Element] = []
    link = tip
    while link != (base or names[0]):
        if link not in above:
            raise ChainError(f"no joints lead from `{base}` to `{tip}`", "name a base that the tip hangs on")
        steps.append(above[link])
        link = above[link].find("parent").get("link")
    hinges: list[Hinge] = []
    last = base or names[0]
    frame = LinkFrame(np.eye(3), np.zeros(3))
    for joint in reversed(steps):
        frame, kind = frame.then(origin_of(joint)), joint.get("type")
        if kind == "fixed":
            continue
        if kind not in HINGES:
            raise ChainError(
                f"{joint.place}: `{joint.get('name')[:60]}` between base and tip is {kind[:20]}; it has to turn",
                "if it is a finger's, name a tip above it, such as the hand's link",
            )
        hinges.append(_hinge(joint, kind, frame))
        last = joint.find("child").get("link")
        frame = LinkFrame(np.eye(3), np.zeros(3))
    if len(hinges) > MAX_CHAIN_JOINTS:
        raise ChainError(f"more than {MAX_CHAIN_JOINTS} joints lead to `{tip}`", "name a base further out")
    return JointChain(base or names[0], tuple(hinges), last, frame)


def _hinge(joint: Element, kind: str, frame: LinkFrame) -> Hinge:
    axis = np.array(numbers_of(joint.findall("axis")[0], "xyz", 3)) if joint.findall("axis") else np.array([1.0, 0, 0])
    if not (length := float(np.linalg.norm(axis))):
        raise MeshError(f"{joint.place}: its axis has no direction")
    low, high = -math.inf, math.inf
    if kind == "revolute":
        low, high = (numbers_of(joint.find("limit"), name, 1, "0")[0] for name in ("lower", "upper"))
        for soft in joint.findall("safety_controller"):
            if {"soft_lower_limit", "soft_upper_limit"} <= set(soft.attributes):
                low = max(low, numbers_of(soft, "soft_lower_limit", 1)[0])
                high = min(high, numbers_of(soft, "soft_upper_limit", 1)[0])
        if low >= high:
            raise MeshError(f"{joint.place}: its limits, {low:g} and {high:g}, leave it no angle")
    return Hinge(joint.get("name"), frame, axis / length, low, high)


def _name_some(names: list[str]) -> str:
    shown = ", ".join(name[:40] for name in names[-12:])
    return shown if len(names) <= 12 else f"..., {shown}"


def rotations(axis: Floats, angles: Floats) -> Floats:
    """Rotations (N, 3, 3) by angles (N,) about a unit axis (3,), by Rodrigues' formula."""
    cross = np.array([[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]])
    sines, versines = np.sin(angles)[:, None, None], (1.0 - np.cos(angles))[:, None, None]
    turns: Floats = np.eye(3) + sines * cross + versines * (cross @ cross)
    return turns
