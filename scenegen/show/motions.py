"""Figures of motions: an animation, a strip of moments, phi over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from PIL import Image

from scenegen.api.outline import chosen_label
from scenegen.api.scenes import SceneSet
from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE
from scenegen.errors.time import NO_SUCH_MOTION, WHICH_MOTION
from scenegen.geometry import NUMPY
from scenegen.lang.check.families import combinations
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import as_rows
from scenegen.scenes.files import check_writable, whole_files, write_whole
from scenegen.scenes.formats.motions.table import MotionArrays, scenes_header
from scenegen.show.figures.charts import phi_chart
from scenegen.show.figures.strip import HELD, STEP, animation, pages, strip, video
from scenegen.show.scenes import PictureStyle, check_kinds, picture_style
from scenegen.validation import as_path

Array = npt.NDArray[np.float64]

KINDS = ("gif", "mp4", "strip", "phi")
MOVING = (".gif", ".mp4")  # endings of files with one motion
SHOWN = 6  # moments of a strip


def figures(
    motions: MotionArrays,
    out: str | Path,
    *kinds: str,
    view: str = "perspective",
    size: tuple[int, int] | None = None,
    distinct: bool = False,
    label: str | None = None,
    workers: int | None = None,
) -> tuple[Path, ...]:
    """See `MotionSet.figures`."""
    folder = as_path("out", out)
    check_kinds(kinds, KINDS)
    look = picture_style(scenes_header(motions.header), len(motions.poses), kinds, view, size, distinct, workers)
    spec = check_text(motions.header.spec.source, "the spec of these motions")
    chosen = chosen_label(spec.labels, label)
    made: dict[str, bytes] = {}
    for number in range(len(motions.poses)):
        name = f"motion_{number + 1:0{max(4, len(str(len(motions.poses))))}d}"
        made |= {f"{name}{end}": data for end, data in _one(motions, number, spec, chosen, kinds, look).items()}
    with whole_files(folder) as put:
        for name, data in made.items():
            put(name, data)
    return tuple(folder / name for name in made)


def animate(
    motions: MotionArrays,
    path: str | Path,
    motion: int | None = None,
    *,
    view: str = "perspective",
    size: tuple[int, int] | None = None,
    distinct: bool = False,
    label: str | None = None,
    workers: int | None = None,
) -> Path:
    """See `MotionSet.animate`; `motion` counts from 1."""
    path = as_path("path", path)
    ending = path.suffix.lower()
    if ending not in MOVING:
        raise RequestError(UNKNOWN_CHOICE(what="ending", name=path.suffix, known=MOVING))
    count = len(motions.poses)
    if motion is None and count > 1:
        raise RequestError(WHICH_MOTION(path=path.name, count=count))
    number = 1 if motion is None else motion
    if not 1 <= number <= count:
        raise RequestError(NO_SUCH_MOTION(number=number, file="the set", first=1, last=count))
    kinds = (ending[1:],)
    look = picture_style(scenes_header(motions.header), len(motions.poses), kinds, view, size, distinct, workers)
    check_writable(path)
    spec = check_text(motions.header.spec.source, "the spec of these motions")
    write_whole(path, _one(motions, number - 1, spec, chosen_label(spec.labels, label), kinds, look)[ending])
    return path


def _one(
    motions: MotionArrays, number: int, spec: CheckedSpec, label: str, kinds: tuple[str, ...], look: PictureStyle
) -> dict[str, bytes]:

    if spec.counts:
        counts = motions.counts(number)
        spec = next(
            one for numbers, one in zip(combinations(spec.counts), spec.members, strict=True) if numbers == counts
        )
        motions, number = motions.alone(number), 0
    signals = over_time(spec, motions.poses[number])
    values = np.nan_to_num(signals[label], posinf=0.0, neginf=0.0).tolist()
    times = np.arange(len(motions.poses[number])) * motions.header.time.dt
    made: dict[str, bytes] = {}
    if "phi" in kinds:
        made["_phi.png"] = phi_chart(times.tolist(), {name: row.tolist() for name, row in signals.items()})
    if set(kinds) <= {"phi"}:
        return made
    drawn = list(look.pictures(SceneSet(motions.poses[number], {}, scenes_header(motions.header)).file()))
    if "gif" in kinds:
        made[".gif"] = animation(drawn, values, label)
    if "mp4" in kinds:
        made[".mp4"] = video(pages(drawn, values, label), STEP, HELD)
    if "strip" in kinds:
        picked = sorted({round(place) for place in np.linspace(0, len(drawn) - 1, SHOWN)})
        small = round(look.size[0] * 0.5), round(look.size[1] * 0.5)
        shown = [drawn[place].resize(small, Image.Resampling.LANCZOS) for place in picked]
        shown_at = [f"t = {times[place]:g} s" for place in picked]
        title = motions.header.spec.title.rstrip(".")
        made["_strip.png"] = strip(shown, [values[place] for place in picked], label, title, times=shown_at)
    return made


def over_time(spec: CheckedSpec, poses: Array) -> dict[str, Array]:
    """phi of each label of one motion (T + 1, N, 3) at every moment: from there on for formulas over time, which may be
    infinite where they look beyond the last."""
    if spec.timed is not None:
        from scenegen.sampling.motions.scores import TraceScores

        rows = TraceScores(spec.timed).signals(np.ascontiguousarray(poses.transpose(1, 2, 0))[..., None])
        return dict(zip(spec.labels, rows[..., 0], strict=True))
    values = evaluate(spec.core, list(as_rows(poses)), NUMPY)
    return {name: np.array(np.broadcast_to(values[name], len(poses))) for name in spec.labels}
