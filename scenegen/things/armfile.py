"""The TOML file of an arm: its ring thinned to few heights, and its base and hand as its URDF file shows them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scenegen.things.chain import HINGES, JointChain
from scenegen.things.meshfile import Read
from scenegen.things.outline import Floats, MeshError, Shadow
from scenegen.things.reach import MeasuredRing, Reach
from scenegen.things.urdf import Element, LinkFrame, MeshFiles, add_shape, elements, links_of, numbers_of, origin_of

THINNING = 0.002  # metres that the ring of a file may be from the measured one, inwards
DIGITS = 4  # decimals of a length in a file
MIN_SIZE = 0.001  # metres: nothing of a base or a hand is smaller
ASSUMED: Mapping[str, tuple[float, ...]] = {
    "base": (0.2, 0.2, 0.2),
    "opening": (0.08,),
    "finger": (0.02, 0.02),
    "finger_length": (0.05,),
    "palm": (0.2, 0.08, 0.1),
}  # metres, where a file shows nothing


@dataclass(frozen=True, slots=True)
class ArmSizes:
    """In metres, by the names of `ASSUMED`: what the shapes of a URDF file show. `floor` is the height of the plane
    that the base stands on above the base link's origin, `skipped` why something was not measured."""

    sizes: Mapping[str, tuple[float, ...]]
    floor: float
    skipped: tuple[str, ...]


def measure_sizes(
    data: bytes, read_mesh: Read, chain: JointChain, reach: Reach, tip: str, approach: Floats
) -> ArmSizes:
    """The box about what stands still below the first joint; and of a hand with fingers that slide: their travel, the
    largest of them, and the link that they slide on. `read_mesh` as in `outline`; a mesh that cannot be read leaves its
    part out. Raises MeshError for a damaged file."""
    robot = elements(data)
    poses = {link.get("name"): (link, pose) for link, pose in links_of(robot)}
    files = MeshFiles(read_mesh, painted=False)
    sizes: dict[str, tuple[float, ...]] = {}
    skipped: list[str] = []
    floor = 0.0
    joints = robot.findall("joint")

    def extent(links: Sequence[str], origin: LinkFrame) -> tuple[Floats, Floats] | None:
        """Lowest and highest x, y, z of the shapes of links in a frame that stands in the root's."""
        shadow = Shadow()
        for name in links:
            link, pose = poses[name]
            inner = LinkFrame(origin.turn.T @ pose.turn, origin.turn.T @ (pose.at - origin.at))
            for shape in link.findall("collision") or link.findall("visual"):
                add_shape(shadow, shape, inner.then(origin_of(shape)), 1.0, files)
        return shadow.spread if shadow.top >= shadow.bottom else None

    try:
        base = poses[chain.base][1]
        if (found := extent(_rigid(joints, chain.base), base)) is not None:
            low, high = found
            x, y = (2.0 * max(high[axis] - at, at - low[axis]) for axis, at in enumerate(reach.axis))
            sizes["base"], floor = (y, x, high[2] - low[2]), round(float(low[2]), DIGITS)
    except MeshError as error:
        skipped.append(f"the base: {error}")
    hand = _rigid(joints, chain.last)
    sliding = [one for one in joints if one.get("type") == "prismatic" and _end(one, "parent") in hand]
    if not sliding:
        if any(one.get("type") in HINGES and _end(one, "parent") in hand for one in joints):
            skipped.append("the hand: its fingers turn, and only sliding ones are measured")
        return ArmSizes(sizes, floor, tuple(skipped))
    travel = [
        numbers_of(one.find("limit"), "upper", 1)[0] - numbers_of(one.find("limit"), "lower", 1, "0")[0]
        for one in sliding
    ]
    sizes["opening"] = (sum(travel),)
    try:
        if (closing := closing_direction(data, chain, tip, approach)) is None:
            raise MeshError("its fingers slide along the direction in which it points")
        hold = poses[tip][1]
        frame = LinkFrame(hold.turn @ np.column_stack([closing, np.cross(approach, closing), approach]), hold.at)
        palm = extent([_end(sliding[0], "parent")], frame)
        fingers = [one for joint in sliding if (one := extent(_rigid(joints, _end(joint, "child")), frame)) is not None]
        if fingers:
            thick, wide = (max(float(high[axis] - low[axis]) for low, high in fingers) for axis in (0, 1))
            sizes["finger"] = thick, wide
        if palm is not None:
            low, high = palm
            sizes["palm"] = *(2.0 * float(max(high[axis], -low[axis])) for axis in (0, 1)), float(high[2] - low[2])
            if fingers:
                sizes["finger_length"] = (max(float(end[2]) for _, end in fingers) - float(high[2]),)
    except MeshError as error:
        skipped.append(f"the hand: {error}")
    return ArmSizes({name: one for name, one in sizes.items() if min(one) >= MIN_SIZE}, floor, tuple(skipped))


def _end(joint: Element, role: str) -> str:
    return joint.find(role).get("link")


def _rigid(joints: Sequence[Element], start: str) -> list[str]:
    """The links that stand still below a link, itself first."""
    found = [start]
    for name in found:
        found += [_end(one, "child") for one in joints if one.get("type") == "fixed" and _end(one, "parent") == name]
    return found


def closing_direction(data: bytes, chain: JointChain, tip: str, approach: Floats) -> Floats | None:
    """The unit vector (3,), in the frame of the tip link, across `approach`, along which the first finger of the hand
    slides or swings; None where there is none. Raises MeshError for a damaged file."""
    robot = elements(data)
    poses, joints = {link.get("name"): pose for link, pose in links_of(robot)}, robot.findall("joint")
    hand = _rigid(joints, chain.last)
    fingers = [one for one in joints if one.get("type") in ("prismatic", *HINGES) and _end(one, "parent") in hand]
    for joint in sorted(fingers, key=lambda one: one.get("type") in HINGES):  # those that slide first
        axis = joint.findall("axis")
        along = np.array(numbers_of(axis[0], "xyz", 3) if axis else [1.0, 0.0, 0.0])
        along = poses[tip].turn.T @ poses[_end(joint, "child")].turn @ along
        along = np.cross(along, approach) if joint.get("type") in HINGES else along - approach * float(approach @ along)
        if (length := float(np.linalg.norm(along))) > 1e-6:
            found: Floats = along / length
            return found
    return None


def thin_ring(reach: MeasuredRing) -> tuple[list[float], list[float], list[float]]:
    """Heights, nearest and farthest of few heights, between which straight lines lie within the ring of all, nowhere
    further in than `THINNING`. Lengths are rounded inwards; heights count from the base link's origin."""
    heights, near, far = (np.array(one) for one in (reach.heights, reach.nearest, reach.farthest))
    inset = np.minimum(THINNING / 2.0, (far - near) / 4.0)
    knot_near, knot_far = np.where(near < 10.0**-DIGITS, 0.0, near + inset), far - inset
    chosen = [0]
    while chosen[-1] < len(heights) - 1:
        first = chosen[-1]
        last = first + 1
        for end in range(first + 2, len(heights)):
            part = slice(first, end + 1)
            share = (heights[part] - heights[first]) / (heights[end] - heights[first])
            inner = knot_near[first] + share * (knot_near[end] - knot_near[first]) - near[part]
            outer = far[part] - knot_far[first] - share * (knot_far[end] - knot_far[first])
            rises = [(one[end] - one[first]) / (heights[end] - heights[first]) for one in (near, far)]
            most = [
                THINNING * math.hypot(1.0, rise) for rise in rises
            ]  # along the level, of what is so far from the line
            inner = np.where(near[part] < 10.0**-DIGITS, 0.0, inner)
            if min(inner.min(), outer.min()) < 0.0 or inner.max() > most[0] or outer.max() > most[1]:
                break
            last = end
        chosen.append(last)
    scale = 10.0**DIGITS
    return (
        [round(one, DIGITS) for one in heights[chosen].tolist()],
        [math.ceil(one * scale - 1e-6) / scale for one in knot_near[chosen].tolist()],
        [math.floor(one * scale + 1e-6) / scale for one in knot_far[chosen].tolist()],
    )


def arm_text(name: str, reach: Reach, measured: ArmSizes, given: Mapping[str, tuple[float, ...]], source: str) -> str:
    """The file, as `read_arm` reads it. `given` are sizes that the user knows, by the names of `ASSUMED`; `source` says
    of what was measured."""
    beside = any(reach.offset)
    lines = [
        f"# {source}",
        f"# The ring {'is that of the last axis' if beside else 'holds for all headings'}, the hand straight down; "
        f"searched every {1000.0 * reach.step:.1f} mm",
        f"# at heights {1000.0 * reach.rise:.0f} mm or less apart, within all joints' limits; collisions are ignored.",
    ]
    for ring in (reach.front, reach.behind):
        if ring is not None and ring.gaps:
            ends = " to ".join(f"{one - measured.floor:.3f}" for one in (ring.gaps[0], ring.gaps[-1]))
            some = f"{len(ring.gaps)} of {len(ring.heights)} heights ({ends} m)"
            lines.append(f"# At {some} more is reached beyond a gap: it is left out.")
    lines.append(f'name = "{name}"')
    lines += _ring_lines(reach.front, measured.floor, beside)
    if beside:
        offset = [round(one, DIGITS) for one in reach.offset]
        lines += _list("offset", offset, "m from that axis to the fingertips, along where they close and to its left")
    lines.append("")

    def line(key: str, part: str, values: Sequence[float]) -> str:
        how = "given" if part in given else "measured" if part in measured.sizes else "assumed"
        shown = ", ".join(f"{round(one, DIGITS):g}" for one in values)
        return f"{key} = {shown if len(values) == 1 else f'[{shown}]'}  # {how}"

    sizes = {**ASSUMED, **measured.sizes, **given}
    lines += [
        "[base]",
        *(line(key, "base", [size]) for key, size in zip(("width", "depth", "height"), sizes["base"], strict=True)),
    ]
    lines += ["", "[hand]", *(line(part, part, sizes[part]) for part in ASSUMED if part != "base")]
    if reach.behind is not None:
        lines += ["", "[behind]  # where the arm leans back over its base"]
        lines += _ring_lines(reach.behind, measured.floor, beside)
    return "\n".join(lines) + "\n"


def _ring_lines(ring: MeasuredRing, floor: float, beside: bool) -> list[str]:
    heights, nearest, farthest = thin_ring(ring)
    lines = _list(
        "heights", [round(one - floor, DIGITS) for one in heights], "m above the plane that the base stands on"
    )
    lines += _list("nearest", nearest, "m from the first axis, at these heights")
    lines += [*_list("farthest", farthest, ""), f"bearing = {_arc(ring.bearing)}  # rad from the base's heading"]
    if beside:
        lines.append(f"turn = {_arc(ring.turn)}  # rad from the direction away from the base to where the hand closes")
    return lines


def _arc(arc: tuple[float, float]) -> list[float]:
    """Rounded inwards; a whole turn and a little more where it is all round."""
    low, high = arc
    if high - low >= math.tau:
        return [-3.1416, 3.1416]
    return [math.ceil(low * 1e4) / 1e4, math.floor(high * 1e4) / 1e4]


def _list(name: str, values: Sequence[float], comment: str) -> list[str]:
    shown = f"{name} = [{', '.join(f'{one:g}' for one in values)}]"
    return [f"# {comment}", shown] if comment else [shown]
