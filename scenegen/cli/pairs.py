"""`scenegen pairs`: pairs of a start and a goal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.cli.options import COUNT, ROOT, SPEC_FILE, field_option, option, parse_counts
from scenegen.cli.output import check_output, complain, detail, print_error, time_left, write_data
from scenegen.sampling.request import DEFAULT_SCENES, SampleRequest, parse_phi

if TYPE_CHECKING:
    from scenegen.api.motions import MotionSet


def pairs(
    spec: Path = SPEC_FILE,
    goal: list[str] | None = option(
        "Wanted phi of the goal: LO:HI, LO: or :HI; NAME=LO:HI names a label; default: 0: for every label.",
        "[NAME=]LO:HI",
    ),
    start: list[str] | None = option("Wanted phi of the start; default: anything but a goal.", "[NAME=]LO:HI"),
    moved: int | None = option("How many objects stand elsewhere; default: start and goal are independent.", "K"),
    grasp: str | None = option(
        "Only pairs with a grasp of what is moved by this robot, the same at both ends; margin 0: or as given.",
        "ROBOT[=LO:HI]",
    ),
    n: int = field_option(SampleRequest, "n", "How many pairs.", default=DEFAULT_SCENES),
    count: list[str] | None = COUNT,
    seed: int = field_option(SampleRequest, "seed", "The same seed gives the same pairs."),
    out: Path | None = option("A .json, .jsonl, .parquet or .csv file; default: JSON to standard output.", "FILE"),
    workers: int | None = field_option(SampleRequest, "workers", "Processes; default: one."),
    timeout: float = field_option(SampleRequest, "timeout"),
    root: Path | None = ROOT,
) -> None:
    """Draw pairs of a start and a goal: rearrangement tasks for planners and goal-conditioned learners.

    \b
      scenegen pairs table_setting -n 1000 --out tasks.jsonl
      scenegen pairs table_setting --moved 1 --out tasks.parquet
      scenegen pairs my.spec --goal task=0: --start task=-0.3:-0.1
      scenegen pairs my.spec --moved 1 --grasp arm=0.01:

    A goal is a scene in the range of --goal. A start is one in the range of --start, or one that is not a goal; what
    the spec requires holds in both. With --moved K, K objects, chosen uniformly, stand elsewhere in the start, each at
    a pose that is uniform over the table, given that the start is in its range.

    With --grasp, one grasp from above of each thing that is moved, at one of 12 yaws in its own frame, is within reach
    and clear of everything at the start and at the goal. Its margin is in metres; of several things it is the least.
    Robots are not moved; without --moved, all else is.

    Where the spec draws how many things there are, start and goal have as many.

    Every pair has phi at both ends, how many objects were moved, and how far, in metres. Each is scored once more
    before it is written. The pairs do not depend on --workers.
    """
    from scenegen.api.pairs import pairs as draw
    from scenegen.api.spec import load
    from scenegen.sampling.grasps import parse_grasp
    from scenegen.scenes.files import check_writable
    from scenegen.scenes.formats.registry import MOTIONS, format_of

    checked = load(spec, root).with_counts(parse_counts(count))
    detail(f"parsed and checked {spec}")
    if out is not None:
        format_of(out, MOTIONS)
        check_writable(out)
    else:
        check_output()
    labels = checked.labels
    ends = [None if not given else parse_phi(given, labels, name) for given, name in ((goal, "goal"), (start, "start"))]
    hold = None if grasp is None else parse_grasp(grasp)
    found = draw(
        checked, ends[0], ends[1], n, moved=moved, grasp=hold, seed=seed, workers=workers, timeout=time_left(timeout)
    )
    complain(*checked.warnings, *found.warnings)
    if out is not None:
        found.save(out)
        print_error(_summary(found, out))
        return
    write_data(found.dump())


def _summary(found: MotionSet, out: Path) -> str:
    far = found.facts["distance"]
    moved = found.facts["moved"]
    many = f"{moved.min():.0f}" if moved.min() == moved.max() else f"{moved.min():.0f} to {moved.max():.0f}"
    plural = "object" if moved.max() == 1 else "objects"
    return f"{len(found):,} pairs in {out}: {many} {plural} moved, {far.min():.2g} to {far.max():.2g} m in all"
