"""Figures of scenes: contact sheet, sweep from hard to solved, heat map, top views with what decides phi. Figures of
motions: animation, strip of moments, phi over time."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from PIL import Image

from scenegen.api.outline import chosen_label
from scenegen.api.scene_arrays import SceneArrays, parts_of
from scenegen.arrays import Array
from scenegen.errors import RequestError, quote_names
from scenegen.errors.requests import (
    NO_SCENES,
    NO_SUCH_NUMBER,
    NOT_ONE_MOTION,
    TIME_NOT_HERE,
    UNKNOWN_CHOICE,
    WRONG_VALUE,
)
from scenegen.geometry import NUMPY, Polygon
from scenegen.lang.formula.core import Atom
from scenegen.lang.formula.interpret import deciding_atom, evaluate
from scenegen.lang.formula.interpret import phi as score
from scenegen.lang.sights import sights_of
from scenegen.lang.spec import CheckedSpec, combinations
from scenegen.looks.overlay import hand_outlines, ring_of
from scenegen.looks.stage import overlaps_of, usual_size
from scenegen.looks.usual import FEW, usual_places
from scenegen.needs import need
from scenegen.pictures.figures import heatmap as heat
from scenegen.pictures.figures.charts import phi_chart
from scenegen.pictures.figures.dimensions import FigureObject, FigureScene, dimensions, outline, short
from scenegen.pictures.figures.sheet import MAX_THUMBNAILS as MOST
from scenegen.pictures.figures.sheet import contact_sheet, thumbnail_size
from scenegen.pictures.figures.sights import FigureSights
from scenegen.pictures.figures.strip import LAST_MS, PAGE_MS, animation, pages, strip, video
from scenegen.pictures.figures.sweep import sweep
from scenegen.pictures.figures.topview import topview
from scenegen.pose import as_poses, as_rows, flat
from scenegen.scenes.data import SceneFile
from scenegen.scenes.files import check_writable, scene_name, whole_files, write_whole
from scenegen.scenes.formats.motions import MotionArrays, scenes_header
from scenegen.things.surfaces import cells_of
from scenegen.validation import as_path, as_words

Progress = Callable[[int, int], None]

STRIP_SCENES = 6  # scenes of a strip
ANIMATION_SCENES = 36  # scenes of an animation


@dataclass(frozen=True, slots=True)
class PictureStyle:
    """How the pictures are drawn that figures are put together from."""

    view: str
    size: tuple[int, int]
    distinct: bool
    workers: int | None
    progress: Progress | None

    def pictures(self, file: SceneFile) -> Iterator[Image.Image]:
        """Those of a file's scenes, one after the other."""
        from scenegen.pictures.render.scenes import pictures

        return pictures(
            file, self.view, self.size, distinct=self.distinct, workers=self.workers, progress=self.progress
        )


def picture_style(
    file: SceneFile,
    count: int,
    kinds: tuple[str, ...],
    view: str,
    size: tuple[int, int] | None,
    distinct: bool,
    workers: int | None,
    progress: Progress | None = None,
) -> PictureStyle:
    """How the pictures of figures are drawn, of `count` scenes or motions with the head `file`. Raises RequestError for
    what cannot be drawn, before anything is."""
    from scenegen.pictures.render.files import check_request

    size = usual_size(file) if size is None else size
    check_request((view,), size, workers)
    if "mp4" in kinds:
        need("av", "for MP4 files")
    if not count:
        raise RequestError(NO_SCENES())
    return PictureStyle(view, size, distinct, workers, progress)


def check_kinds(kinds: tuple[str, ...], known: tuple[str, ...]) -> tuple[str, ...]:
    """The names of figures. Raises RequestError for unknown ones, and for none."""
    if not kinds:
        wanted = (
            f'something to draw, after the folder: figures("pictures", "{known[0]}"); there are {quote_names(known)}'
        )
        raise RequestError(WRONG_VALUE(argument="kinds", value="empty", wanted=wanted))
    for kind in kinds:
        if kind not in known:
            raise RequestError(UNKNOWN_CHOICE(what="figure", name=kind, known=known))
    return kinds


@dataclass(frozen=True, slots=True)
class SweepFrames:
    """The frames of a sweep: phi of the label, the picture and the objects that overlap in each; the strip shows the
    `picked` ones."""

    label: str
    phi: list[float]
    picked: list[int]
    drawn: list[Image.Image]
    notes: list[str]


@dataclass(frozen=True)
class Job:
    """What a figure is made of: the scenes, the names of all figures that are made, the label that they are about (the
    first if None), and how pictures are drawn."""

    scenes: SceneArrays
    kinds: tuple[str, ...]
    label: str | None
    look: PictureStyle

    @property
    def spec(self) -> CheckedSpec:
        """The spec of the scenes. Raises SpecError."""
        return self.scenes.header.spec.checked_spec

    @cached_property
    def moving(self) -> SweepFrames:
        """One layout from hard to solved; drawn once for the strip and the animation. Raises RequestError."""
        frames, chosen = sweep(self.scenes, self.label, ANIMATION_SCENES)
        phi = [float(value) for value in frames.phi[chosen]]
        picked = sorted({round(place) for place in np.linspace(0, len(frames) - 1, STRIP_SCENES)})
        file = frames.file()
        if not {"gif", "mp4"} & {*self.kinds}:
            file = file.model_copy(update={"scenes": [file.scenes[place] for place in picked]})
            phi, picked = [phi[place] for place in picked], list(range(len(picked)))
        notes = [", ".join(pairs) for pairs in overlaps_of(file)]
        return SweepFrames(chosen, phi, picked, list(self.look.pictures(file)), notes)


def figures(
    scenes: SceneArrays,
    out: str | Path,
    kinds: tuple[str, ...],
    *,
    view: str = "perspective",
    size: tuple[int, int] | None = None,
    distinct: bool = False,
    label: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Make figures in the folder `out` (made if its parent is there); the paths of their files.

    `kinds` are of "sheet" (contact_sheet.png), "sweep" (sweep.png: one layout from hard to solved, as a strip), "gif"
    (the same as sweep.gif), "mp4" (as sweep.mp4, with the extra `video`), "heatmap" (heatmap.png: where each object
    goes) and "topview" (scene_0001_topview.svg, ...: names, headings, and the atom that decides phi of `label`, the
    first one if left out, as a dimension line). `view` and `size` are those of the pictures that sheet, sweep, gif and
    mp4 are put together from; `distinct` colours objects apart that would look the same.

    Raises RequestError for what cannot be drawn, DataError where the scenes' spec is of no use, OutputError.
    """
    folder = as_path("out", out)
    kinds = check_kinds(as_words("kinds", kinds, '("sheet", "gif")'), tuple(FIGURES))
    look = picture_style(scenes.header, len(scenes), kinds, view, size, distinct, workers, progress)
    job = Job(scenes, kinds, label, look)
    made: dict[str, bytes] = {}
    for kind, make in FIGURES.items():
        if kind in kinds:
            made |= make(job)
    return write_files(folder, made)


def write_files(folder: Path, made: dict[str, bytes]) -> tuple[Path, ...]:
    """Write files by their names, together or not at all; their paths. Raises OutputError."""
    with whole_files(folder) as put:
        for name, data in made.items():
            put(name, data)
    return tuple(folder / name for name in made)


def sheet(job: Job) -> dict[str, bytes]:
    """All scenes with their phi."""
    file = job.scenes.file()
    first = file.model_copy(update={"scenes": file.scenes[:MOST]})
    small = thumbnail_size(job.look.size, len(job.scenes))
    drawn = job.look.pictures(first)
    thumbnails = [picture.resize(small, Image.Resampling.LANCZOS) for picture in drawn]
    return {"contact_sheet.png": contact_sheet(file, thumbnails)}


def halves(pictures: Sequence[Image.Image], which: Sequence[int]) -> list[Image.Image]:
    """Some of the pictures, half as large."""
    width, height = pictures[0].size
    return [pictures[k].resize((round(width * 0.5), round(height * 0.5)), Image.Resampling.LANCZOS) for k in which]


def sweep_strip(job: Job) -> dict[str, bytes]:
    """One layout from hard to solved, as a strip of pictures."""
    moving = job.moving
    shown = halves(moving.drawn, moving.picked)
    values, notes = [moving.phi[place] for place in moving.picked], [moving.notes[place] for place in moving.picked]
    return {"sweep.png": strip(shown, values, moving.label, job.scenes.header.spec.title.rstrip("."), notes)}


def sweep_gif(job: Job) -> dict[str, bytes]:
    """The same, animated."""
    return {"sweep.gif": animation(job.moving.drawn, job.moving.phi, job.moving.label, job.moving.notes)}


def sweep_mp4(job: Job) -> dict[str, bytes]:
    """The same as a video."""
    moving = job.moving
    return {"sweep.mp4": video(pages(moving.drawn, moving.phi, moving.label, moving.notes), PAGE_MS, LAST_MS)}


def heatmap(job: Job) -> dict[str, bytes]:
    """Where each object goes."""
    return {"heatmap.png": heat.heatmap(job.scenes.file(), distinct=job.look.distinct)}


def topviews(job: Job) -> dict[str, bytes]:
    """Every scene from above, with what decides phi as a dimension."""
    whole, scenes = job.spec, job.scenes
    if whole.timed is not None:
        raise RequestError(TIME_NOT_HERE(file=whole.name))
    chosen = chosen_label(whole.labels, job.label)
    zones = [FigureObject(one.name, one.footprint, one.pose, zone=True) for one in whole.regions]
    made = {}
    for part in parts_of(whole, scenes):
        spec = part.spec
        for number, rows in zip(part.which + 1, part.rows.T, strict=True):
            values = evaluate(spec.core, rows.tolist())
            node = deciding_atom(spec.core, chosen, values)
            atom = spec.core.nodes[node]
            assert isinstance(atom, Atom)
            phi = values[spec.core.labels[chosen]]
            sights, seen = _sights(spec, rows)
            usual = usual_places(spec, rows)
            names = [f"{name}: {seen[place]}" if place in seen else name for place, name in enumerate(spec.objects)]
            things = [
                FigureObject(name, shape.footprint, (float(x), float(y), float(theta)), inside=cells_of(shape))
                for name, shape, (x, y, theta) in zip(names, spec.shapes, flat(as_poses(rows)), strict=False)
            ]
            view = FigureScene(
                [*zones, *things],
                x=spec.workspace.x,
                y=spec.workspace.y,
                marks=dimensions(spec.core, node, rows.tolist()),
                caption=[f"{atom.text} decides", f"{chosen} = {short(phi)}"],
                good=phi >= 0.0,
                sights=sights,
                usual=usual if len(usual) <= FEW else (),
            )
            made[f"{scene_name(int(number), len(scenes))}_topview.svg"] = topview(view, width=480).encode()
    return dict(sorted(made.items()))


def _sights(spec: CheckedSpec, row: Array) -> tuple[FigureSights | None, dict[int, str]]:
    """What robots and cameras do in a scene (3M,), and by object which shares of it are seen."""
    found = sights_of(spec)
    if found is None:
        return None, {}
    rows, poses = row[:, None], flat(as_poses(row))
    places = [(float(x), float(y), float(theta)) for x, y, theta in poses]
    foot = spec.heights or (0.0,) * len(spec.shapes)
    rings = [
        (places[which], ring_of(shape.arm, foot[which] or 0.0)) for which, shape in enumerate(spec.shapes) if shape.arm
    ]
    hands = [
        tuple(
            outline(Polygon(corners), places[one.thing])
            for corners in hand_outlines(spec, one.thing, one.robot, float(one.yaw[0]))
        )
        for one in found.grips(rows)
    ]
    seen: dict[int, str] = {}
    for one in found.views(rows):
        words = f"{one.camera} sees {one.words(0)}"
        seen[one.thing] = f"{seen[one.thing]}; {words}" if one.thing in seen else words
    return FigureSights(rings, spec.cameras, hands), seen


# Figure -> what makes its files: name -> bytes.
FIGURES: dict[str, Callable[[Job], dict[str, bytes]]] = {
    "sheet": sheet,
    "sweep": sweep_strip,
    "gif": sweep_gif,
    "mp4": sweep_mp4,
    "heatmap": heatmap,
    "topview": topviews,
}


MOTION_FIGURES = ("gif", "mp4", "strip", "phi")
MOTION_ENDINGS = (".gif", ".mp4")  # endings of files with one motion


def motion_figures(
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
    check_kinds(kinds, MOTION_FIGURES)
    look = picture_style(scenes_header(motions.header), len(motions.poses), kinds, view, size, distinct, workers)
    spec = motions.header.spec.checked_spec
    chosen = chosen_label(spec.labels, label)
    made: dict[str, bytes] = {}
    for number in range(len(motions.poses)):
        name = f"motion_{number + 1:0{max(4, len(str(len(motions.poses))))}d}"
        made |= {
            f"{name}{end}": data for end, data in _motion_files(motions, number, spec, chosen, kinds, look).items()
        }
    return write_files(folder, made)


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
    if ending not in MOTION_ENDINGS:
        raise RequestError(UNKNOWN_CHOICE(what="ending", name=path.suffix, known=MOTION_ENDINGS))
    count = len(motions.poses)
    if motion is None and count > 1:
        raise RequestError(NOT_ONE_MOTION(path=path.name, count=count))
    number = 1 if motion is None else motion
    if not 1 <= number <= count:
        raise RequestError(NO_SUCH_NUMBER(what="motion", number=number, file="the set", first=1, last=count))
    kinds = (ending[1:],)
    look = picture_style(scenes_header(motions.header), len(motions.poses), kinds, view, size, distinct, workers)
    check_writable(path)
    spec = motions.header.spec.checked_spec
    write_whole(path, _motion_files(motions, number - 1, spec, chosen_label(spec.labels, label), kinds, look)[ending])
    return path


def _motion_files(
    motions: MotionArrays, number: int, spec: CheckedSpec, label: str, kinds: tuple[str, ...], look: PictureStyle
) -> dict[str, bytes]:

    if spec.counts:
        counts = motions.numbers_of(number)
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
    drawn = list(look.pictures(SceneArrays(motions.poses[number], {}, scenes_header(motions.header)).file()))
    if "gif" in kinds:
        made[".gif"] = animation(drawn, values, label)
    if "mp4" in kinds:
        made[".mp4"] = video(pages(drawn, values, label), PAGE_MS, LAST_MS)
    if "strip" in kinds:
        picked = sorted({round(place) for place in np.linspace(0, len(drawn) - 1, STRIP_SCENES)})
        shown = halves(drawn, picked)
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
    values = score(spec.core, list(as_rows(poses)), NUMPY)
    return {name: np.array(np.broadcast_to(values[name], len(poses))) for name in spec.labels}
