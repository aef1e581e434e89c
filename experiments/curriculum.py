"""Learning with scenes ordered by phi: the paper's Fig. 5 in two settings, what it depends on, and what lies beyond."""

from __future__ import annotations

from experiments.charts import check_libraries
from experiments.curricula import bars, tables
from experiments.curricula.cases import SETTINGS, TASKS, WORDS, beyond, figure5, sensitivity, strategies
from experiments.curricula.runs import Runner, spec_of
from experiments.figures.episodes import Panel, episodes
from experiments.page import picture
from experiments.plan import Plan
from experiments.report import Report
from experiments.tabular.grid import grid_task

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
    runner = Runner(plan.cache(), plan.quick)
    runner.all(cases, plan.workers, plan.tell)
    found = [(case, runner.of(case)) for case in cases]
    bound = -(-95 * len(grid.unsatisfied) // (100 * 4 * largest))
    blocks = {
        "fig5": picture("curriculum.png", "Fig. 5 of the paper"),
        **tables.tables(found, sizes, bound),
        "bars": bars.bars(found, largest),
    }
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
