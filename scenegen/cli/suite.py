"""`scenegen suite`: graded starts, frozen; policies on them, and what their outcomes say."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.many import names_of
from scenegen.cli.options import (
    WORKERS,
    argument,
    check_action,
    choices,
    errors_of_placing,
    find_spec,
    metres,
    option,
    radians,
    seconds,
)
from scenegen.cli.output import print_error, print_message, progress_bar, time_left
from scenegen.errors import RequestError
from scenegen.errors.requests import ARGUMENT_SYNTAX, MISSING_ARGUMENT, OUT_OF_PLACE, UNKNOWN_CHOICE

if TYPE_CHECKING:
    from scenegen.learn.success.files import Letter
    from scenegen.play.suites.outcomes import EpisodeOutcome
    from scenegen.sampling.engine.engines import JobResult
    from scenegen.sampling.request import Range

SUITE_OPTIONS = {  # of each action: those that must be given, and the others
    "new": (
        ("out",),
        (
            "bands",
            "log10p",
            "n",
            "seed",
            "success",
            "start",
            "tolerance",
            "grid",
            "headings",
            "grasp",
            "goal",
            "timeout",
            "workers",
        ),
    ),
    "check": ((), ()),
    "run": (
        ("world", "policy", "out"),
        (
            "bands",
            "reverse",
            "instruction",
            "episodes",
            "order",
            "blind",
            "resume",
            "until",
            "against",
            "steps",
            "timeout",
            "workers",
        ),
    ),
    "report": (("out",), ("pictures", "workers")),
    "envhub": (("world", "out"), ("reverse", "steps")),
    "metaworld": (("out",), ()),
}

HAND_SECONDS = 86_400.0  # of an episode that a person sets and judges


def suite(
    action: str = argument(
        "new, check, run, report, envhub or metaworld.", "ACTION", autocompletion=choices(*SUITE_OPTIONS)
    ),
    places: list[str] = argument(
        "For new: spec files. Else the suite's folder, or the name of a shipped suite; for report then files of"
        " outcomes.",
        "PLACE...",
    ),
    out: Path | None = option("new, envhub: a folder. run: .jsonl. report: .html or .md. metaworld: .pkl.", "DIR|FILE"),
    bands: list[str] | None = option(
        "new: how many, equally probable; default: 5. Or a range of phi, once for each. run: the names of some.",
        "K|NAME=LO:HI|NAME",
    ),
    log10p: bool = option("new: --bands are ranges of log10 of the share of starts at least as hard."),
    n: int | None = option("new: starts of each band of each task; default: 50.", "N"),
    seed: int | None = option("new: the same seed gives the same suite; default: 0.", "N"),
    success: str | None = option("new: the label of success; default: goal, or the only one.", "LABEL"),
    start: str | None = option("new: the label that starts satisfy; default: start, if there is one.", "LABEL"),
    tolerance: str | None = option(
        "new: errors of placing in which starts stay in their band, proved.", "LENGTH,ANGLE", parser=errors_of_placing
    ),
    grid: float | None = option("new: objects stand on a grid of this step.", "LENGTH", parser=metres),
    headings: float | None = option("new: headings are multiples of this.", "ANGLE", parser=radians),
    grasp: str | None = option(
        "new: starts from which one thing can be moved to the goal by this robot, with one grasp at both ends; margin"
        " 0: or as given.",
        "ROBOT[=LO:HI]",
    ),
    goal: str | None = option("new: with --grasp, phi of success at these goals; default: 0:.", "LO:HI"),
    world: str | None = option(
        "run, envhub: table, libero, hand: (a person; hand:FOLDER looks at pictures), or a function of a task that"
        " makes its environment.",
        "MODULE:NAME|FILE.py:NAME",
    ),
    policy: str | None = option("run: what acts.", "MODULE:NAME|FILE.py:NAME|URL"),
    reverse: bool = option("run, envhub: the reversed tasks, whose starts are goals."),
    instruction: str | None = option("run: own, or empty: the same starts without a word.", "own|empty"),
    episodes: str | None = option("run: some of them; default: all.", "FIRST:END"),
    order: Path | None = option("run: episodes as `scenegen stage order` wrote them, in its order.", ".csv"),
    blind: str | None = option("run: with an --order of pairs, what this policy is called there.", "A|B"),
    resume: bool = option("run: go on with a file."),
    until: str | None = option("run: stop once one of two policies is shown to be better.", "decided"),
    against: Path | None = option("run: with --until, the outcomes of the other policy.", ".jsonl"),
    steps: int | None = option("run, envhub: of an episode at most; default: 1000.", "N"),
    pictures: int | None = option("report: of so many starts; default: 8.", "N"),
    timeout: float | None = option("new: seconds in all. run: of an episode. Default: 600.", "SECONDS", parser=seconds),
    workers: int | None = WORKERS,
) -> None:
    """Compare policies on suites: graded starts of several tasks, frozen, the same ones for everybody.

    \b
      scenegen suite new a.spec b.spec --bands 5 -n 50 --out mine/
      scenegen suite new a.spec --bands near=-0.1:0 --bands far=:-0.1 --out mine/
      scenegen suite new a.spec --bands 2 --tolerance 1.5cm,15deg --out hand/
      scenegen suite new a.spec --bands 2 --grasp arm=1cm: --out room/
      scenegen suite check tabletop
      scenegen suite run mine/ --world w.py:make --policy p.py:act --out a.jsonl
      scenegen suite run mine/ --world w.py:make --policy q.py:act --out b.jsonl
          --until decided --against a.jsonl
      scenegen suite report mine/ a.jsonl b.jsonl --out report.html
      scenegen suite envhub mine/ --world table --out hub/
      scenegen suite metaworld mine/ --out tasks.pkl

    A start is a scene in which the label of success does not hold. Of each task there are as many starts of each band
    of phi, and the suite knows how probable each band is. Starts are ordinary scenes files: `scenegen render
    mine/a.json` draws them. The first line of a spec is its instruction; one `# reverse: ...` makes a reversed task of
    a spec with a label of its starts.

    `run` writes a line for each episode; one that fails, dies or hangs counts as a failure, and the others go on.
    With --until decided it looks after every episode, by a test that allows it, and stops once one policy is shown to
    be better. `envhub` writes a folder that LeRobot loads from the hub, `metaworld` a list of tasks for Meta-World.
    """
    given = {name: value for name, value in locals().items() if value is not None and value is not False}
    del given["action"], given["places"]
    check_action("suite", action, given, SUITE_OPTIONS)
    actions: dict[str, Any] = {
        "new": _new,
        "check": _check,
        "run": _run,
        "report": _report,
        "envhub": _envhub,
        "metaworld": _metaworld,
    }
    actions[action](places, **given)


def _new(
    specs: list[str],
    out: Path,
    bands: list[str] | None = None,
    tolerance: tuple[float, float] = (0.0, 0.0),
    grid: float = 0.0,
    headings: float = 0.0,
    grasp: str | None = None,
    goal: str | None = None,
    **given: Any,
) -> None:
    from scenegen.play.suites.forgiving import Placing
    from scenegen.play.suites.new import new_suite
    from scenegen.sampling.grasps import parse_grasp
    from scenegen.sampling.request import parse_phi
    from scenegen.scenes.files import is_stream

    paths = [find_spec(Path(one)) for one in specs]
    names = names_of([Path("stdin") if is_stream(path) else path for path in paths])
    given |= {"timeout": time_left(given.get("timeout", 600.0)), "placing": Placing(tolerance, grid, headings)}
    given |= {} if grasp is None else {"grasp": parse_grasp(grasp)}
    given |= {} if goal is None else {"goal": parse_phi([goal], ["goal"], "goal")["goal"]}
    with progress_bar() as bar:
        task = bar.add_task("tasks", total=None)

        def report_task(ended: JobResult, done: int, count: int) -> None:
            bar.update(task, completed=done, total=count)
            if ended.errors:
                print_message(f"{ended.name} failed:")

        made = new_suite(list(zip(names, paths, strict=True)), out, bands=_bands(bands), told=report_task, **given)
    starts = sum(made.n * len(one.bands) for one in made.tasks)
    print_error(f"{starts:,} starts of {len(made.tasks)} tasks in {out}, digest {made.digest}")


def _bands(texts: list[str] | None) -> int | dict[str, Range]:
    """The number of bands, or their ranges by name. Raises RequestError with a caret."""
    from scenegen.sampling.request import parse_phi

    if not texts:
        return 5
    if len(texts) == 1 and texts[0].isdecimal():
        return int(texts[0])
    return parse_phi(texts, [text.partition("=")[0].strip() for text in texts if "=" in text] or ["band"], "bands")


def _check(places: list[str]) -> None:
    from scenegen.play.suites.suite import check_suite

    for place in places:
        for one in check_suite(place):
            what = "reversed tasks" if one.reverse else "tasks"
            print_error(f"{place}: {len(one):,} starts of {len(one.tasks)} {what} are as they were made: {one.digest}")


def _run(
    places: list[str],
    out: Path,
    episodes: str | None = None,
    bands: list[str] | None = None,
    reverse: bool = False,
    until: str | None = None,
    against: Path | None = None,
    order: Path | None = None,
    blind: Letter | None = None,
    **given: Any,
) -> None:
    from scenegen.play.suites.loading import HAND
    from scenegen.play.suites.outcomes import LETTERS, RUN_FIELDS, compare_outcomes, differences, read_outcomes
    from scenegen.play.suites.run import run_suite
    from scenegen.play.suites.suite import Suite
    from scenegen.scenes.formats.registry import check_ending

    first, _, end = (episodes or ":").partition(":")
    if not all(one.isdecimal() or not one for one in (first, end)) or (episodes is not None and ":" not in episodes):
        raise RequestError(ARGUMENT_SYNTAX(what="a part of a suite", form="FIRST:END", example="0:500"))
    if until not in (None, "decided"):
        raise RequestError(UNKNOWN_CHOICE(what="end", name=until, known=("decided",)))
    if until and not against:
        raise RequestError(
            MISSING_ARGUMENT(argument="against", question="which outcomes is this policy compared with?")
        )
    if blind not in (None, *LETTERS):
        raise RequestError(UNKNOWN_CHOICE(what="letter", name=blind, known=LETTERS))
    if blind and not order:
        raise RequestError(MISSING_ARGUMENT(argument="order", question="which order of pairs has this letter?"))
    if against and not until:
        raise RequestError(MISSING_ARGUMENT(argument="until", question="--until decided goes with --against"))
    check_ending(out, ".jsonl")
    loaded = Suite.load(places[0], reverse=reverse)
    some = loaded.part(int(first or 0), int(end) if end else None, bands)
    if order:
        from scenegen.play.stage.order import read_order

        given["order"] = read_order(order, loaded, some, blind)
        some = list(given["order"].trials)
    successes = done = 0
    errors = Counter[str]()
    bar = progress_bar()
    if given["world"].startswith(HAND):  # a person has the terminal, and takes time
        bar.disable = True
        given = {"timeout": HAND_SECONDS, **given}
        if given.get("workers", 1) > 1:
            raise RequestError(
                OUT_OF_PLACE(argument="workers", rule="is for worlds without people", remedy="leave it out")
            )
    with bar:
        task = bar.add_task("episodes", total=len(some))

        def report_episode(outcome: EpisodeOutcome, count: int, total: int) -> None:
            nonlocal successes, done
            successes, done = successes + outcome.success, count
            errors.update([outcome.error] if outcome.error is not None else [])
            bar.update(task, completed=count, total=total, description=f"episodes: {successes} of {count} succeed")

        try:
            run_suite(loaded, out, episodes=some, against=against, told=report_episode, **{"workers": 1, **given})
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt(f"interrupted after {done} episodes; --resume goes on in {out}") from error
    print_error(f"{successes:,} of {done:,} episodes succeed; outcomes in {out}")
    if errors:
        often = errors.most_common(1)[0][0]
        print_error(f"{errors.total():,} of them ended by an error and count as failures, most often: {often}")
    if against:
        mine, other = read_outcomes(out), read_outcomes(against)
        found, unlike = compare_outcomes(mine, other), differences(mine.header, other.header)
        fields = ", ".join(name for name in RUN_FIELDS if name in unlike)
        print_error(
            f"{'decided' if found.is_decided else 'not decided'}: better in {found.first}, worse in {found.second}"
            f" of {found.n} episodes{f', but the runs differ in {fields}' if fields else ''}"
        )


def _report(places: list[str], out: Path, **given: Any) -> None:
    from scenegen.play.suites.report import report_suite

    if not places[1:]:
        raise RequestError(MISSING_ARGUMENT(argument="outcomes", question="which files is the report about?"))
    print_error(f"report in {report_suite(places[0], [Path(one) for one in places[1:]], out, **given)}")


def _envhub(places: list[str], out: Path, **given: Any) -> None:
    from scenegen.play.suites.harnesses.envhub import write_envhub

    if places[1:]:
        raise RequestError(OUT_OF_PLACE(option=places[1], rule="is a second suite", remedy="a folder has one"))
    names = write_envhub(places[0], out, **given)
    print_error(f'{len(names)} files in {out}: upload the folder, then make_env("OWNER/NAME", trust_remote_code=True)')


def _metaworld(places: list[str], out: Path) -> None:
    from scenegen.play.suites.harnesses.metaworld import write_metaworld

    if places[1:]:
        raise RequestError(OUT_OF_PLACE(option=places[1], rule="is a second suite", remedy="a file has one"))
    with progress_bar() as bar:
        shown = bar.add_task("starts", total=None)
        off = write_metaworld(places[0], out, told=lambda done, count: bar.update(shown, completed=done, total=count))
    print_error(f"tasks in {out}, each set in Meta-World: objects are at most {1000.0 * off:.2f} mm off there")
