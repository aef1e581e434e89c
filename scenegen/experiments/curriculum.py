"""Learning with scenes ordered by phi: the paper's Fig. 5 in two settings, what it depends on, and what lies beyond."""

from __future__ import annotations

from functools import cache

from scenegen.experiments.charts import check_libraries
from scenegen.experiments.curricula.cases import SETTINGS, TASKS, WORDS, beyond, figure5, sensitivity
from scenegen.experiments.curricula.models import model_of
from scenegen.experiments.curricula.runs import Runner
from scenegen.experiments.curricula.tables import at_largest, by_size, data, grouped, knobs
from scenegen.experiments.curricula.tables import beyond as beyond_table
from scenegen.experiments.curricula.tables import sensitivity as sensitivity_table
from scenegen.experiments.curricula.words import bars, notes, summary
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
    largest = sizes[-1]
    cases = [
        *figure5(sizes, plan.seeds),
        *sensitivity(QUICK_CHANGED if plan.quick else CHANGED, plan.seeds[:3]),
        *beyond(largest, plan.seeds),
    ]
    folder = plan.out / FOLDER
    ensure_folder(folder)
    write_whole(folder / ".gitignore", b"*\n")
    runner = Runner(folder / f"{'quick-' if plan.quick else ''}curriculum.json", cache(lambda task: model_of(plan, task)))
    runner.all(cases, plan.workers, plan.tell)
    found = [(case, runner.of(case)) for case in cases]
    grid = runner.grid("A", largest)
    bound = -(-95 * len(grid.unsatisfied) // (100 * 4 * largest))
    panels = []
    for task in TASKS:
        for setting in SETTINGS:
            curves: dict[str, dict[int, list[int]]] = {}
            for (name, size), runs in grouped(
                [(c, r) for c, r in found if c.group == f"fig5 {setting}" and c.task == task],
                lambda case: (case.name, case.size),
            ).items():
                curves.setdefault(name, {})[size] = [one.episodes for one in runs if one.episodes >= 0]
            panels.append(Panel(f"{setting}, task {task}: {WORDS[task]}", curves))
    blocks = [
        *summary(found, largest, bound),
        picture(
            "curriculum.png",
            "Fig. 5 of the paper",
            "Episodes until the greedy policy solves 95 % of all cells: the mean of the seeds, the band from the least to"
            " the greatest. Left the paper's kind of learner, right one with nothing but sensible settings. Scenes come"
            " from the exact sampler; the dotted line is self-paced with scenes of a trained model.",
        ),
        f"## At M = {largest}",
        at_largest(found, largest),
        *notes(largest),
        "## Over the size of the table",
        *(by_size(found, setting, sizes) for setting in SETTINGS),
        f"## What it depends on (M = {QUICK_CHANGED if plan.quick else CHANGED}, {len(plan.seeds[:3])} seeds)",
        sensitivity_table(found),
        knobs(found),
        "## Beyond",
        beyond_table(found, bound),
        *beyond_words(bound, largest),
        "## Bars",
        listed(bars(found, largest)),
    ]
    facts = {"bound": bound, "runs": data(found)}
    return Report("curriculum", "Learning with a curriculum", blocks, facts, {"curriculum.png": episodes(panels, 2)})


def beyond_words(bound: int, largest: int) -> list[str]:
    return []
