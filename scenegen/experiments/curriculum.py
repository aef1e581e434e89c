"""Learning with scenes ordered by phi: the paper's Fig. 5 in two settings, what it depends on, and what lies beyond."""

from __future__ import annotations

from functools import cache

from scenegen.curriculum.tabular.grid import grid_task
from scenegen.experiments.charts import check_libraries
from scenegen.experiments.curricula import tables, words
from scenegen.experiments.curricula.cases import SETTINGS, TASKS, WORDS, beyond, figure5, sensitivity, strategies
from scenegen.experiments.curricula.models import model_of
from scenegen.experiments.curricula.runs import Runner, spec_of
from scenegen.experiments.figures.episodes import Panel, episodes
from scenegen.experiments.plan import FOLDER, Plan
from scenegen.experiments.report import Report, listed, picture
from scenegen.formats.files import ensure_folder, write_whole

SIZES, QUICK_SIZES = tuple(range(10, 101, 10)), (4, 8)
CHANGED, QUICK_CHANGED = 40, 4  # the size at which one thing after the other is changed


def run(plan: Plan) -> Report:
    """All runs, Fig. 5, the tables."""
    check_libraries()
    sizes = QUICK_SIZES if plan.quick else SIZES
    largest, changed = sizes[-1], QUICK_CHANGED if plan.quick else CHANGED
    grid = grid_task(spec_of("A"), 2 * largest + 1)
    cases = [
        *figure5(sizes, plan.seeds),
        *sensitivity(changed, plan.seeds[:3]),
        *beyond(largest, plan.seeds),
        *strategies(largest, grid.levels, plan.seeds[:3]),
    ]
    folder = plan.out / FOLDER
    ensure_folder(folder)
    write_whole(folder / ".gitignore", b"*\n")
    runner = Runner(
        folder / f"{'quick-' if plan.quick else ''}curriculum.json", cache(lambda task: model_of(plan, task))
    )
    runner.all(cases, plan.workers, plan.tell)
    found = [(case, runner.of(case)) for case in cases]
    bound = -(-95 * len(grid.unsatisfied) // (100 * 4 * largest))
    blocks = [
        *words.summary(found, largest),
        picture(
            "curriculum.png",
            "Fig. 5 of the paper",
            "Episodes until the greedy policy solves 95 % of all cells: the mean of the seeds, the band from the least"
            " to the greatest. Left the paper's kind of learner, right the fair one. Scenes are the exact sampler's;"
            " the dotted line is self-paced with scenes of a trained model.",
        ),
        *words.setting(largest),
        f"## At M = {largest}",
        tables.at_largest(found, largest),
        words.sources(found, largest),
        words.corridors(found, largest),
        "## Over the size of the table",
        *(tables.by_size(found, setting, sizes) for setting in SETTINGS),
        f"## What it depends on (task A unless it says B; M = {changed}, seeds {', '.join(map(str, plan.seeds[:3]))})",
        words.ties(found),
        tables.sensitivity(found),
        tables.knobs(found),
        f"## Strategies for any learner (fair, task A, M = {largest}, seeds {', '.join(map(str, plan.seeds[:3]))})",
        words.strategies(),
        tables.strategies(found),
        f"## Beyond (task A, M = {largest})",
        words.beyond(bound, largest),
        tables.beyond(found, bound),
        "## Bars",
        listed(words.bars(found, largest)),
    ]
    facts = {"bound": bound, "runs": tables.data(found)}
    return Report(
        "curriculum",
        "Learning with a curriculum",
        blocks,
        facts,
        {"curriculum.png": episodes(_panels(found), len(SETTINGS))},
    )


def _panels(found: tables.Found) -> list[Panel]:
    """A panel per task and setting."""
    panels = []
    for task in TASKS:
        for setting in SETTINGS:
            mine = [pair for pair in found if pair[0].group == f"fig5 {setting}" and pair[0].task == task]
            curves: dict[str, dict[int, list[int]]] = {}
            for (name, size), runs in tables.grouped(mine, lambda case: (case.name, case.size)).items():
                curves.setdefault(name, {})[size] = [one.episodes for one in runs if one.episodes >= 0]
            panels.append(Panel(f"{setting}, task {task}: {WORDS[task]}", curves))
    return panels
