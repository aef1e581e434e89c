"""`scenegen render`: pictures and figures of scenes, and of motions."""

from __future__ import annotations

import re
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.many import JobMessages, names_of, refuse_engine, shared_work
from scenegen.cli.options import ADDRESS, ENGINE, MESHES_OPTION, PICTURES, POSES_OF, argument, option
from scenegen.cli.output import note, note_others, print_error, progress_bar
from scenegen.errors import RequestError, Source, Span
from scenegen.errors.program import NOT_ITS_MODEL
from scenegen.errors.requests import ARGUMENT_SYNTAX, NOT_ONE_MOTION, OUT_OF_PLACE, OUT_OF_RANGE
from scenegen.scenes.formats.registry import is_motions

if TYPE_CHECKING:
    from scenegen.api.scenes import SceneSet
    from scenegen.errors import Diagnostic


TELL = 10.0  # seconds between two lines of progress where there is no terminal


def render(
    sources: list[Path] = argument("A scenes file; several get a folder each in --out.", "SCENES"),
    out: Path = option("The folder for the pictures, or a .gif or .mp4 file for one motion.", "DIR|FILE", default=...),
    view: list[str] | None = option(
        "top, perspective, front or three-quarter; more than one may be given. Default: top and perspective.", "VIEW"
    ),
    camera: str | None = option("A camera that the spec declares, instead of --view.", "CAMERA"),
    size: str | None = option(
        "Width and height of a picture in pixels. Default: 640x480, wider for a wide workspace.", "WxH"
    ),
    distinct: bool = option("Colour objects apart that would look the same."),
    transparent: bool = option("Leave out the ground below the table."),
    depth: bool = option("Also write the depth of every pixel (PNG and NPZ)."),
    masks: bool = option("Also write what every pixel shows (PNG and NPZ)."),
    figure: list[str] | None = option(
        "A figure instead of pictures: sheet, sweep, gif, mp4, heatmap or topview; of motions gif, mp4, "
        "strip or phi; more than one may be given.",
        "FIGURE",
    ),
    label: str | None = option("The label that figures are about; default: the first."),
    motion: int | None = option("The motion of several that a .gif or .mp4 file shows.", "NUMBER"),
    renderer: str = option("software, or egl where there is a graphics card.", "NAME", default="software"),
    looks: str | None = option(
        "random, or a TOML file: draw table, ground, walls, light, camera and tints for each scene.", "LOOKS"
    ),
    meshes: Path | None = MESHES_OPTION,
    spec: Path | None = POSES_OF,
    seed: int = option("With --looks: the same seed gives the same looks.", default=0),
    workers: int | None = option("Processes that draw; default: one per core."),
    pictures: int | None = PICTURES,
    engine: str = ENGINE,
    address: str | None = ADDRESS,
) -> int:
    """Draw every scene from above and in perspective, and a contact sheet of all with phi under each picture.

    \b
      scenegen render scenes.json --out pictures
      scenegen render scenes.json --out pictures --view front --size 1280x960
      scenegen render scenes.json --out dataset --view front --depth --masks
      scenegen render scenes.json --out pictures --camera front
      scenegen render scenes.json --out figures --figure sweep --figure heatmap
      scenegen render scenes.json --out dataset --looks random --seed 3
      scenegen render sets/*.json --out pictures
      scenegen render poses.csv --spec my.spec --out pictures
      scenegen render settled.json --out pictures
      scenegen render motions.jsonl --out motion.mp4 --motion 3
      scenegen render motions.jsonl --out figures --figure mp4 --figure strip

    Settled scenes are drawn as they came to rest; in figures each object stands upright where it lies.

    Several files are drawn side by side, by --engine, each into a folder of its name in --out; one that fails is
    reported by its name, the others are drawn, and the exit status is 1.

    --camera draws what a `camera` statement of the spec pictures, with its field of view and the shape of its picture.

    Needs no display and no GPU. Pictures are numbered in scene order: scene_0001_top.png,
    scene_0001_perspective.png. cameras.json holds intrinsics and extrinsics, and what the numbers in masks stand for.

    \b
    Figures:
      sheet    all scenes with their phi: contact_sheet.png
      sweep    one layout from hard to solved: sweep.png
      gif      the same, animated: sweep.gif
      mp4      the same as a video, with the extra `video`: sweep.mp4
      heatmap  where each object goes: heatmap.png
      topview  what decides phi, as a dimension: scene_0001_topview.svg

    \b
    Figures of motions:
      gif      the motion, with phi below: motion_0001.gif
      mp4      the same as a video: motion_0001.mp4
      strip    six moments side by side: motion_0001_strip.png
      phi      phi over time: motion_0001_phi.png
    """
    from scenegen.scenes.formats.registry import is_motions

    shape = None if size is None else parse_size(size)
    alone = names_film(out)
    if alone and (figure or len(sources) > 1):
        raise _only(f"--out {out.name}", "is for one file, without --figure")
    if motion is not None and not alone:
        raise _only("--motion", "goes with --out FILE.gif or FILE.mp4")
    if camera is not None and view:
        raise _only("--camera", "is a view, and goes without --view")
    if seed and looks is None:
        raise _only("--seed", "goes with --looks")
    if spec is not None and (alone or any(map(is_motions, sources))):
        raise _only("--spec", "goes with scenes, and motions say themselves of what spec they are")
    if pictures is not None and (figure or alone or len(sources) > 1):
        raise _only("--pictures", "goes with pictures of one file")
    if not (figure or alone):
        if label is not None:
            raise _only("--label", "goes with --figure, and with --out FILE.gif or FILE.mp4")
    elif view is not None and len(view) > 1:
        raise _only("--view", "may be given once with --figure")
    else:
        of_pictures: dict[str, object] = {
            "--camera": camera,
            "--transparent": transparent,
            "--depth": depth,
            "--masks": masks,
        }
        of_pictures |= {"--renderer": renderer != "software", "--looks": looks, "--meshes": meshes}
        for name, given in of_pictures.items():
            if given:
                raise _only(name, "goes with pictures, not with --figure")
    of_figures = {"view": view[0] if view else "perspective", "size": shape, "distinct": distinct, "label": label}
    look: dict[str, Any] = {
        "size": shape,
        "views": tuple(view) if view else None,
        "camera": camera,
        "distinct": distinct,
        "transparent": transparent,
        "depth": depth,
        "masks": masks,
        "renderer": renderer,
        "looks": looks,
        "meshes": meshes,
        "seed": seed,
    }
    if len(sources) > 1:
        from scenegen.scenes.files import ensure_folder

        jobs = [(name, (source, out / name)) for name, source in zip(names_of(sources), sources, strict=True)]
        ensure_folder(out)
        job = _Drawing(tuple(figure or ()), of_figures if figure else look, spec)
        return shared_work(job, jobs, engine, workers, address, "drawing")
    refuse_engine(engine, address)
    if alone:
        print_error(draw_motion(sources[0], out, motion, {**of_figures, "workers": workers}))
    elif figure:
        _figures(sources[0], out, tuple(figure), {**of_figures, "workers": workers}, spec)
    else:
        draw(_scenes(sources[0], spec), out, pictures, workers=workers, **look)
    return 0


@dataclass(frozen=True, slots=True)
class _Drawing:
    """The job of one file among several: (scenes, folder). Without `kinds` of figures, pictures."""

    kinds: tuple[str, ...]
    look: dict[str, Any]
    spec: Path | None

    def __call__(self, paths: tuple[Path, Path]) -> JobMessages:
        source, out = paths
        made = figures_of_motions(source, out, self.kinds, {**self.look, "workers": 1}) if self.kinds else None
        if made is not None:
            return JobMessages((f"drew {len(made)} figures in {out}",))
        found = _scenes(source, self.spec)
        if not self.kinds:
            drawn = found.render(out, workers=1, **self.look)
            return JobMessages((f"drew {len(drawn.pictures)} pictures in {out}",), _unknown(found))
        made = found.figures(out, *self.kinds, workers=1, **self.look)
        return JobMessages((f"drew {len(made)} figures in {out}",), _unknown(found))


def _scenes(source: Path, spec: Path | None) -> SceneSet:
    """The scenes of a file, of `spec` where it holds poses alone. Raises DataError, RequestError."""
    from scenegen.api.reading import read_scenes
    from scenegen.api.scenes import check_count
    from scenegen.api.spec import load

    found = read_scenes(source, spec=None if spec is None else load(spec))
    check_count(found)
    note(*found.warnings)
    return found


def parse_size(text: str) -> tuple[int, int]:
    """`640x480` -> (640, 480). Raises RequestError."""
    match = re.fullmatch(r"(\d{1,6})x(\d{1,6})", text, re.ASCII)
    if match is None:
        here = Span(Source("size", text, argument=True), 0, len(text))
        raise RequestError(ARGUMENT_SYNTAX(here, what="a size", form="WIDTHxHEIGHT", example="640x480"))
    return int(match[1]), int(match[2])


def draw(scenes: SceneSet, out: Path, most: int | None = None, **look: Any) -> None:
    """Draw with a progress bar, or where nobody sees one a line every ten seconds, and say where the pictures are and
    how fast they came. `most` is how many scenes are drawn, from the first; `look` is that of `SceneSet.render`."""
    if most is not None:
        if most < 1:
            raise RequestError(OUT_OF_RANGE(argument="pictures", value=most, wanted="1 or more"))
        scenes = scenes[:most]
    started = told = time.perf_counter()

    def report(done: int, total: int) -> None:
        nonlocal told
        bar.update(task, completed=done)
        if bar.disable and done < total and time.perf_counter() - told > TELL:
            told = time.perf_counter()
            print_error(f"drew {done:,} of {total:,} scenes")

    with progress_bar() as bar:
        task = bar.add_task("drawing", total=len(scenes))
        drawn = scenes.render(out, progress=report, **look)
    took = time.perf_counter() - started
    note(*_unknown(scenes))
    if look.get("meshes") is not None:
        from scenegen.pictures.render.scenes import still_outlines

        if left := still_outlines(scenes.header, look["meshes"]):
            note(NOT_ITS_MODEL(outlines=left))
    speed = f"{len(scenes) / took:.3g} scenes/s"
    print_error(f"drew {len(drawn.pictures)} pictures in {out} ({speed}); contact sheet: {drawn.sheet}")
    note_others(out, len(scenes), ".png")


def _figures(source: Path, out: Path, kinds: tuple[str, ...], look: dict[str, Any], spec: Path | None) -> None:
    from scenegen.pictures.scenes import figures

    made, scenes = figures_of_motions(source, out, kinds, look), None
    if made is None:
        scenes = _scenes(source, spec)
        with progress_bar() as bar:
            task = bar.add_task("drawing", total=None)
            made = figures(
                scenes,
                out,
                kinds,
                progress=lambda done, total: bar.update(task, completed=done, total=total),
                **look,
            )
        note(*_unknown(scenes))
    print_error(f"drew {len(made)} figures in {out}" if len(made) > 4 else f"drew {', '.join(map(str, made))}")
    if scenes is not None and "topview" in kinds:
        note_others(out, len(scenes), "_topview.svg")


def _unknown(scenes: SceneSet) -> tuple[Diagnostic, ...]:
    """A note about names that are not in the library and are drawn as blocks, with the names of the library."""
    from scenegen.things import ASSETS, PLAIN, UNKNOWN, has_picture

    shown = {*ASSETS, *PLAIN} - {UNKNOWN}
    unknown = [one.name for one in scenes.header.objects if one.shape.asset not in shown and not has_picture(one.name)]
    return (NOT_ITS_MODEL(blocks=unknown),) if unknown else ()


def _only(name: str, rule: str) -> Exception:
    return RequestError(OUT_OF_PLACE(option=name, rule=rule, remedy="see `scenegen render --help`"))


FILM_ENDINGS = (".gif", ".mp4", ".avi", ".m4v", ".mkv", ".mov", ".webm", ".webp")  # the first two are written
MOTION_KINDS = ("gif", "mp4", "strip", "phi")  # figures of motions
SHARED_KINDS = ("gif", "mp4")  # of scenes, too: those of a sweep


SAMPLE = "`scenegen sample` draws motions of a spec with `time`"


def names_film(out: Path) -> bool:
    """Whether this is the file of one motion, not a folder."""
    return out.suffix.lower() in FILM_ENDINGS and not out.is_dir()


def draw_motion(source: Path, out: Path, motion: int | None, look: dict[str, Any]) -> str:
    """Draw one motion of a file into `out`; what to say of it. Raises what `MotionSet.animate` raises, and RequestError
    for a file of scenes."""
    from scenegen.api.motions import read_motions

    if not is_motions(source):
        raise RequestError(NOT_ONE_MOTION(path=out.name, file=source))
    return f"drew {read_motions(source).animate(out, motion, **look)}"


def figures_of_motions(
    source: Path, out: Path, kinds: tuple[str, ...], look: dict[str, Any]
) -> tuple[Path, ...] | None:
    """Draw figures of every motion of a file; None where the file or the figures are not of motions. Raises what
    `MotionSet.figures` raises, and RequestError for figures of both kinds."""
    from scenegen.api.motions import read_motions

    if not is_motions(source):
        wrong = next((kind for kind in kinds if kind in MOTION_KINDS and kind not in SHARED_KINDS), None)
        if wrong is not None:
            rule = f"is of motions, and {source} holds scenes"
            raise RequestError(OUT_OF_PLACE(option=f"--figure {wrong}", rule=rule, remedy=SAMPLE))
        return None
    others = [kind for kind in kinds if kind not in MOTION_KINDS]
    if not others:
        return read_motions(source).figures(out, *kinds, **look)
    if len(others) < len(kinds):
        rule, remedy = "is of scenes, the others are of motions", "call `scenegen render` once for either"
        raise RequestError(OUT_OF_PLACE(option=f"--figure {others[0]}", rule=rule, remedy=remedy))
    return None
