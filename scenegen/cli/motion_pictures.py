"""`scenegen render` of motion files: figures of each motion, or one motion as a .gif or .mp4 file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.errors.requests import OUT_OF_PLACE
from scenegen.errors.time import NOT_ONE_MOTION
from scenegen.scenes.formats.registry import is_motions

if TYPE_CHECKING:
    from scenegen.api.motions import MotionSet

ENDINGS = (".gif", ".mp4", ".avi", ".m4v", ".mkv", ".mov", ".webm", ".webp")  # the first two are written
KINDS = ("gif", "mp4", "strip", "phi")  # figures of motions
SHARED = ("gif", "mp4")  # of scenes, too: those of a sweep


SAMPLE = "`scenegen sample` draws motions of a spec with `time`"


def names_film(out: Path) -> bool:
    """Whether this is the file of one motion, not a folder."""
    return out.suffix.lower() in ENDINGS and not out.is_dir()


def film(source: Path, out: Path, motion: int | None, look: dict[str, Any]) -> str:
    """Draw one motion of a file into `out`; what to say of it. Raises what `MotionSet.animate` raises, and RequestError
    for a file of scenes."""
    from scenegen.errors import RequestError

    if not is_motions(source):
        raise RequestError(NOT_ONE_MOTION(path=out.name, file=source))
    return f"drew {read(source).animate(out, motion, **look)}"


def figures(source: Path, out: Path, kinds: tuple[str, ...], look: dict[str, Any]) -> tuple[Path, ...] | None:
    """Draw figures of every motion of a file; None where the file or the figures are not of motions. Raises what
    `MotionSet.figures` raises, and RequestError for figures of both kinds."""
    from scenegen.errors import RequestError

    if not is_motions(source):
        wrong = next((kind for kind in kinds if kind in KINDS and kind not in SHARED), None)
        if wrong is not None:
            rule = f"is of motions, and {source} holds scenes"
            raise RequestError(OUT_OF_PLACE(option=f"--figure {wrong}", rule=rule, remedy=SAMPLE))
        return None
    others = [kind for kind in kinds if kind not in KINDS]
    if not others:
        return read(source).figures(out, *kinds, **look)
    if len(others) < len(kinds):
        rule, remedy = "is of scenes, the others are of motions", "call `scenegen render` once for either"
        raise RequestError(OUT_OF_PLACE(option=f"--figure {others[0]}", rule=rule, remedy=remedy))
    return None


def read(source: Path) -> MotionSet:
    """The motions of a file. Raises DataError."""
    from scenegen.api.motions import read_motions

    return read_motions(source)
