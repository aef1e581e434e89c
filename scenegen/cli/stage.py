"""`scenegen stage`: the starts of a suite on a real table."""

from __future__ import annotations

from contextlib import nullcontext, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.options import argument, check_action, choices, metres, option
from scenegen.cli.output import print_error
from scenegen.errors import DataError, RequestError, quote_names
from scenegen.errors.requests import MISSING_ARGUMENT, OUT_OF_PLACE, OUT_OF_RANGE, UNKNOWN_CHOICE

if TYPE_CHECKING:
    from scenegen.play.suites.suite import GradedStart, Suite

SMALL_TAG = 0.015  # metres
STAGE_OPTIONS = {  # of each action: those that must be given, and the others
    "mat": (("out",), ("paper", "grid")),
    "sheet": ((), ("out", "paper", "grid", "episodes", "reverse")),
    "check": (("episodes",), ("photo", "corners", "poses", "camera", "ruler", "out", "grid", "reverse")),
    "overlay": (("episodes", "out"), ("photo", "live", "camera", "reverse")),
    "order": (("out",), ("episodes", "pairs", "reverse")),
}


def stage(
    action: str = argument("mat, sheet, check, overlay or order.", "ACTION", autocompletion=choices(*STAGE_OPTIONS)),
    suite: str = argument("The suite's folder, or the name of a shipped suite.", "SUITE"),
    out: Path | None = option(
        "mat: .pdf. sheet: .pdf; without it, cards are printed. check: scenes of what stands there. overlay: .png."
        " order: .csv.",
        "FILE",
    ),
    paper: str | None = option("mat and sheet: a4, a3, a2, a1, a0 or letter; default: a4.", "SIZE"),
    pairs: bool = option("order: each start twice in succession, for two policies whose letters are drawn by lot."),
    grid: float | None = option("From line to line; default: 2cm.", "LENGTH", parser=metres),
    episodes: str | None = option("sheet: some of them, or one; default: all. check: which one.", "FIRST:END|N"),
    photo: Path | None = option("check: a photograph of the mat, objects with their tags on them.", "FILE"),
    live: str | None = option("overlay: a camera's number, a video or a URL; redrawn until Ctrl-C.", "SOURCE"),
    corners: Path | None = option("check: with --photo, a table of pixels of outlines: object, u, v.", "FILE"),
    poses: Path | None = option("check: a table of poses instead: mug.x, mug.y, mug.theta, ...", "FILE"),
    camera: Path | None = option("check: what a calibration gave, JSON; default: fitted with the mat.", "FILE"),
    ruler: float | None = option("check: how long the mat's ruler is by another one.", "LENGTH", parser=metres),
    reverse: bool = option("The reversed tasks."),
) -> int:
    """Set the starts of a suite on a real table: print a mat and sheets, check what stands there.

    \b
      scenegen stage mat tabletop --out mat.pdf --paper a3
      scenegen stage sheet tabletop --episodes 0:10 --out sheets.pdf
      scenegen stage sheet tabletop --episodes 7
      scenegen stage check tabletop --episodes 7 --photo table.jpg
      scenegen stage overlay tabletop --episodes 7 --photo table.jpg --out o.png
      scenegen stage order tabletop --episodes 0:100 --pairs --out order.csv

    The mat has a tag at each corner, a grid with names, and a ruler: print it at 100 %. Behind it are the tags of all
    objects, one to be glued onto each. A sheet has the outlines of one start; a card says the same in words.

    `check` says by how much each object is off, phi of what really stands there and its band; where that is not the
    start's, or something that the spec requires does not hold, it says what to move, and the exit status is 1.

    `overlay` draws the outlines into a picture, or again and again into those of a camera. `order` writes an order in
    which things move little from one start to the next, for `scenegen suite run --order`; with --pairs each start
    twice, for two policies by letters A and B, and a second file that says whose turn is when.
    """
    given = {name: value for name, value in locals().items() if value is not None and value is not False}
    del given["action"], given["suite"]
    check_action("stage", action, given, STAGE_OPTIONS)
    actions: dict[str, Any] = {"mat": _mat, "sheet": _sheet, "check": _check, "overlay": _overlay, "order": _order}
    return int(actions[action](suite, **given) or 0)


def _mat(place: str, out: Path, paper: str = "a4", **given: Any) -> None:
    from scenegen.play.stage.mat import draw_mat, draw_tags
    from scenegen.play.stage.pdf import write_pdf
    from scenegen.play.stage.stage import TableStage
    from scenegen.play.suites.suite import Suite
    from scenegen.scenes.files import write_whole

    _check_paper(out, paper)
    suite = Suite.load(place)
    stage = TableStage.from_suite(suite, *given.values())
    write_whole(out, write_pdf([draw_mat(stage, suite.name, paper), *draw_tags(stage, suite.name)]))
    width, height = (100.0 * side for side in stage.size)
    print_error(f"a mat of {width:.1f} x {height:.1f} cm and {len(stage.things)} tags of things in {out}")
    small = [thing.name for thing in stage.things if thing.side < SMALL_TAG]
    if small:
        print_error(
            f"cameras hardly see tags as small as those of {quote_names(small)}: check with --corners or --poses"
        )


def _sheet(place: str, out: Path | None = None, paper: str = "a4", grid: float | None = None, **given: Any) -> None:
    from scenegen.play.stage.pdf import write_pdf
    from scenegen.play.stage.sheet import draw_start, write_card
    from scenegen.play.stage.stage import TableStage
    from scenegen.scenes.files import write_whole

    if out is not None:
        _check_paper(out, paper)
    suite, starts = _starts(place, **given)
    stage = TableStage.from_suite(suite, *([] if grid is None else [grid]))
    if out is None:
        print("\n".join(write_card(stage, one) for one in starts), end="")
        return
    write_whole(out, write_pdf(draw_start(stage, one, paper) for one in starts))
    print_error(f"{len(starts):,} sheets in {out}")


def _check(
    place: str,
    episodes: str,
    photo: Path | None = None,
    corners: Path | None = None,
    poses: Path | None = None,
    camera: Path | None = None,
    ruler: float | None = None,
    out: Path | None = None,
    grid: float | None = None,
    reverse: bool = False,
) -> int:
    from scenegen.play.stage.check import check_poses, scene_of
    from scenegen.play.stage.measure import measure_poses
    from scenegen.play.stage.stage import TableStage

    _check_one("photo", photo, "poses", poses, "give --photo, a picture of the table, or --poses, a table of places")
    for name, value in (("corners", corners), ("camera", camera), ("ruler", ruler)):
        if value is not None and photo is None:
            raise RequestError(OUT_OF_PLACE(argument=name, rule="goes with --photo", remedy="leave it out"))
    suite, start = _find_start(place, episodes, reverse)
    stage = TableStage.from_suite(suite, *([] if grid is None else [grid]))
    found = check_poses(start, measure_poses(stage, start, photo, corners, poses, camera, ruler))
    print("\n".join(found.lines(stage)))
    if out is not None:
        print_error(f"what stands there is in {scene_of(found).save(out)}")
    return 0 if found.ok else 1


def _check_one(name: str, value: object, other: str, its: object, question: str) -> None:
    """Raises RequestError unless one of two arguments is given."""
    if value is None and its is None:
        raise RequestError(MISSING_ARGUMENT(argument=name, question=question))
    if value is not None and its is not None:
        raise RequestError(OUT_OF_PLACE(argument=other, rule=f"does not go with --{name}", remedy="leave one out"))


def _find_start(place: str, episodes: str, reverse: bool) -> tuple[Suite, GradedStart]:
    """A suite and the one start of it that is on the table. Raises RequestError."""
    suite, starts = _starts(place, episodes, reverse)
    if len(starts) != 1:
        raise RequestError(OUT_OF_RANGE(argument="episodes", value=episodes, wanted="one number: what is on the table"))
    return suite, starts[0]


def _overlay(
    place: str,
    episodes: str,
    out: Path,
    photo: Path | None = None,
    live: str | None = None,
    camera: Path | None = None,
    reverse: bool = False,
) -> None:
    from scenegen.needs import is_installed
    from scenegen.play.stage.camera import Lens, Photograph, find_camera, read_frames
    from scenegen.play.stage.overlay import draw_overlay, judge_picture, render_start
    from scenegen.play.stage.stage import TableStage
    from scenegen.scenes.files import write_whole
    from scenegen.scenes.formats.registry import check_ending

    check_ending(out, ".png")
    _check_one("photo", photo, "live", live, "give --photo, a picture of the mat, or --live, a camera")
    suite, start = _find_start(place, episodes, reverse)
    stage, lens = TableStage.from_suite(suite), None if camera is None else Lens.read(camera)
    if photo is not None:
        pictures = iter([Photograph.read(photo)])
    else:
        pictures = (Photograph.from_picture(frame, f"camera {live}") for frame in read_frames(str(live)))
    beside, said, fault = None, "", None
    with suppress(KeyboardInterrupt) if live is not None else nullcontext():
        for picture in pictures:
            try:
                seen = find_camera(stage, picture, lens, start)
            except DataError as error:
                fault = error
                continue
            if beside is None and is_installed("pybullet"):
                beside = render_start(stage, start, seen)
            before, said = said, judge_picture(stage, start, picture, seen)
            write_whole(out, draw_overlay(stage, start, picture, seen, said, beside))
            if said != before:
                print_error(said)
    if not said and fault is not None:
        raise fault
    print_error(f"episode {start.number} drawn into {photo or f'camera {live}'}: {out}")


def _order(place: str, out: Path, episodes: str | None = None, pairs: bool = False, reverse: bool = False) -> None:
    from scenegen.play.stage.order import key_of, order_starts, travel_of, write_order
    from scenegen.scenes.files import write_whole
    from scenegen.scenes.formats.registry import check_ending

    check_ending(out, ".csv")
    suite, starts = _starts(place, episodes, reverse)
    key = key_of(out)
    ordered = order_starts(suite, starts)
    trials, letters = write_order(suite, ordered, pairs)
    write_whole(out, trials)
    if pairs:
        write_whole(key, letters)
    before, after = (100.0 * travel_of(suite, one) for one in (starts, ordered))
    print_error(
        f"{len(starts):,} starts in {out}: things move {after:.0f} cm from one to the next, not {before:.0f} cm"
    )
    if pairs:
        print_error(f"{key} says which letter is whose turn: keep it from the person who sets and judges")


def _check_paper(out: Path, paper: str) -> None:
    from scenegen.play.stage.pdf import PAPERS
    from scenegen.scenes.formats.registry import check_ending

    check_ending(out, ".pdf")
    if paper not in PAPERS:
        raise RequestError(UNKNOWN_CHOICE(what="paper", name=paper, known=PAPERS))


def _starts(place: str, episodes: str | None = None, reverse: bool = False) -> tuple[Suite, list[GradedStart]]:
    """A suite and some of its starts. Raises RequestError."""
    from scenegen.play.suites.suite import Suite

    suite = Suite.load(place, reverse=reverse)
    first, colon, end = (episodes or ":").partition(":")
    if not all(one.isdecimal() or not one for one in (first, end)) or not (first or colon):
        wanted = "FIRST:END, or a number"
        raise RequestError(OUT_OF_RANGE(argument="episodes", value=episodes, wanted=wanted))
    last = int(end) if end else None if colon else int(first) + 1
    return suite, [suite[number] for number in suite.part(int(first or 0), last)]
