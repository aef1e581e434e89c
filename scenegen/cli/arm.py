"""`scenegen arm`: what a robot arm reaches from above, from its URDF file."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

from scenegen.cli.options import argument, choices, option
from scenegen.cli.output import detail, print_error
from scenegen.errors import DataError, RequestError
from scenegen.errors.files import NO_ARM
from scenegen.errors.requests import OUT_OF_PLACE

APPROACHES = {
    f"{sign}{name}": tuple(float(sign + "1") if name == one else 0.0 for one in "xyz")
    for sign in ("", "-")
    for name in "xyz"
}
MAX_URDF_BYTES = 8_000_000


def arm(
    urdf: Path = argument("The URDF file of the arm.", "FILE.urdf"),
    tip: str = option(
        "The link whose origin is between the fingertips, or the last one of the arm.", "LINK", default=...
    ),
    out: Path = option("The file of the arm; its name is that of the arm.", "FILE.toml", default=...),
    base: str = option("The link that stands on the table; the root if left out.", "LINK", default=""),
    approach: str = option(
        "The direction of the tip link in which the hand points.",
        "AXIS",
        default="z",
        autocompletion=choices(*APPROACHES),
    ),
    tool: str = option(
        "How far beyond the tip link's origin, in that direction, the fingertips are: 16cm.", "LENGTH", default="0"
    ),
    base_size: str | None = option("Width, depth and height of the base: 20cm,25cm,15cm.", "W,D,H"),
    opening: str | None = option("The widest gap between the open fingers.", "LENGTH"),
    finger: str | None = option("A finger along the direction in which the hand closes, and across.", "T,W"),
    finger_length: str | None = option("From a fingertip up to the palm.", "LENGTH"),
    palm: str | None = option("The palm along the direction in which the hand closes, across, and upwards.", "L,W,H"),
) -> None:
    """Measure what an arm reaches while its hand points down, and write it as a file for `robot`.

    \b
      scenegen arm panda.urdf --tip panda_grasptarget --out my_arm.toml
      scenegen arm ur5e.urdf --tip tool0 --tool 16cm --out ur5e.toml

    At each height, the last joint can be between two radii about the first, which has to be upright. They are
    found by forward kinematics within the limits of all joints: in about a minute, and with the same bytes each time.
    Base and hand are measured on the file's shapes where it has them and the fingers slide. Sizes that you give count
    instead, and the file says of each whether it was measured, given or assumed. Lengths without a unit are metres.
    """
    import numpy as np

    from scenegen.scenes.files import check_writable, read_bytes, write_whole
    from scenegen.scenes.formats.registry import check_ending
    from scenegen.things.armfile import arm_text, closing_direction, measure_sizes
    from scenegen.things.chain import ChainError, read_chain
    from scenegen.things.outline import MeshError
    from scenegen.things.reach import measure_reach

    check_writable(out, urdf)
    check_ending(out, ".toml")
    if approach not in APPROACHES:
        raise RequestError(
            OUT_OF_PLACE(option="--approach", rule=f"is no axis: {approach}", remedy=f"use {', '.join(APPROACHES)}")
        )
    ahead = np.array(APPROACHES[approach])
    sizes = {
        "base": (base_size, 3),
        "opening": (opening, 1),
        "finger": (finger, 2),
        "finger_length": (finger_length, 1),
        "palm": (palm, 3),
    }
    given = {name: _lengths(text, count, name) for name, (text, count) in sizes.items() if text is not None}
    (beyond,) = _lengths(tool, 1, "tool", least=0.0)
    data = read_bytes(urdf, "a URDF file", limit=MAX_URDF_BYTES)
    try:
        chain = read_chain(data, tip, base)
        reach = measure_reach(chain, ahead, beyond, closing_direction(data, chain, tip, ahead))
        detail(f"searched {len(reach.front.heights)} heights")
        measured = measure_sizes(data, _reader(urdf), chain, reach, tip, ahead)
    except ChainError as error:
        raise DataError(NO_ARM(file=urdf, reason=str(error), remedy=error.remedy)) from None
    except MeshError as error:
        raise DataError(NO_ARM(file=urdf, reason=str(error))) from None
    name = re.sub(r"[^\w.-]", "_", out.stem)
    source = f"Measured by `scenegen arm` on {urdf.name}, tip {tip}" + (
        f" and {beyond:g} m beyond it." if beyond else "."
    )
    text = arm_text(name, reach, measured, given, "".join(one if one.isprintable() else "?" for one in source))
    write_whole(out, text.encode())
    for reason in measured.skipped:
        print_error(f"not measured: {reason}")
    near, far = min(reach.front.nearest), max(reach.front.farthest)
    print_error(f"wrote {out}: from {near:.2f} to {far:.2f} m, {len(text):,} bytes")


def _lengths(text: str, count: int, name: str, least: float = 0.001) -> tuple[float, ...]:
    """So many lengths as typed, in metres. Raises RequestError."""
    from scenegen.geometry.primitives import quantity
    from scenegen.things.arms import LARGEST_ARM

    found: list[float] = []
    for word in text.split(","):
        parts = re.fullmatch(r"\s*(.*?)\s*(mm|cm|m|)\s*", word)
        try:
            found.append(quantity(parts[1], parts[2] or "m")[0] if parts else float(word))
        except ValueError:
            found.append(-1.0)
    if len(found) != count or not all(least <= one <= LARGEST_ARM for one in found):
        wanted = "a length" if count == 1 else f"{count} lengths with commas between"
        flag = "--" + ("base-size" if name == "base" else name.replace("_", "-"))
        raise RequestError(
            OUT_OF_PLACE(
                option=flag,
                rule=f"needs {wanted} from {least:g} to {LARGEST_ARM:g} m, not {text[:40]}",
                remedy=f"write {flag} {','.join(['4cm'] * count)}",
            )
        )
    return tuple(found)


def _reader(urdf: Path) -> Callable[[str], bytes]:
    """What reads the meshes that the file names, in its folder or below those above it."""
    from scenegen.resources import note_input
    from scenegen.scenes.own_files import MAX_OWN_FILE_BYTES
    from scenegen.things.meshfile import local_name
    from scenegen.things.outline import MeshError

    def read(name: str) -> bytes:
        folder = urdf.resolve().parent
        path = folder / local_name(name, folder, Path(folder.anchor))
        try:
            note_input(path)
            if not path.is_file() or path.stat().st_size > MAX_OWN_FILE_BYTES:
                raise MeshError(f"mesh {name[:60]} is no file that can be read")
            return path.read_bytes()
        except (OSError, ValueError):
            raise MeshError(f"mesh {name[:60]} cannot be read") from None

    return read
