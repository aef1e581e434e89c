"""What the figures say, in words that follow the figures."""

from __future__ import annotations

from scenegen.experiments.curricula.cases import BY_LOT, GAP, PLAIN, Case
from scenegen.experiments.curricula.runs import Record
from scenegen.experiments.curricula.tables import Found, grouped, mean, ratio
from scenegen.experiments.report import listed, short

PAPER = {"A": 23.0}  # times fewer episodes, self-paced against the baseline, at M = 100 (Sec. V-B)
TWENTY, FIFTEEN = 20.0, 15.0
FAIR, FAIR_GOAL = 20_000, 10_000
ANY_LEARNER, ANY_GOAL = 500, 200
STEPWISE = "one step"


def summary(found: Found, largest: int) -> list[str]:
    """The first paragraph: how much is left of the advantage."""
    at = _largest(found, largest)

    def fewer(setting: str, task: str, what: str = "episodes") -> str:
        runs = at[f"fig5 {setting}", task, "self-paced"]
        return ratio(mean(at[f"fig5 {setting}", task, "uniform"], what), mean(runs, what))

    def count(setting: str, task: str, name: str) -> str:
        value = mean(at[f"fig5 {setting}", task, name], "episodes")
        return "never" if value is None else short(value)

    return [
        f"**In short.** What a curriculum saves is decided by the learner it is compared on. At M = {largest} the"
        f" paper's kind of learner needs {fewer('paper-like', 'A')} times fewer episodes with the self-paced curriculum"
        f" on task A and {fewer('paper-like', 'B')} times fewer on task B (the paper: {PAPER['A']:g} times). Three"
        " plain changes to the learner (ties decided by lot instead of for the first action, one random action in ten"
        f" instead of three, larger steps) bring its baseline on A from {count('paper-like', 'A', 'uniform')} down to"
        f" {count('fair', 'A', 'uniform')} episodes, without any curriculum, and **the advantage shrinks to"
        f" {fewer('fair', 'A')} times on A and {fewer('fair', 'B')} times on B**. Where the policy must be right"
        f" however its ties are decided, it is {fewer('fair', 'A', 'any_episodes')} and"
        f" {fewer('fair', 'B', 'any_episodes')}. A learner that uses what it sees saves more than any choice of scenes"
        " does: see Beyond.",
    ]


def ties(found: Found) -> str:
    """Which of the changes matters most."""
    groups = grouped(found, lambda case: (case.group, case.name))

    def said(group: str) -> str:
        means = [
            mean(groups[f"sensitivity paper-like: {group}", name], "episodes") for name in ("uniform", "self-paced")
        ]
        return f"{_short(means[0])} episodes against {_short(means[1])}, {ratio(*means)} times"

    return (
        f"Of all the changes the ties weigh most. The paper-like learner as it is: {said(PLAIN)}; with nothing changed"
        f" but that ties are decided by lot: {said(BY_LOT)}. A learner that takes the first action where it knows"
        " nothing walks straight off the table, or to and fro, and finds the goal by random actions alone; scenes near"
        " the goal save it from that, and so does a die."
    )


def setting(largest: int) -> list[str]:
    """What is run, in a list."""
    return [
        "## What is run",
        listed(
            [
                "One object moves on a table of (2M + 1)² cells, the other stands in the middle; the state is the cell."
                " phi of a cell is the spec's, of the object in its middle. Episodes end after 4M steps, at the goal"
                " (reward 10) or off the table (-10, a *reset*); gamma is 0.95.",
                "*Paper-like*: ties go to the first action, epsilon 0.3, alpha 0.1. The linear schedule goes through"
                " the levels of phi, a cell wide each, in 6M³ episodes; self-paced draws from the newest two and goes"
                " on after 40 successes in a row.",
                "*Fair*: ties by lot, epsilon 0.1, alpha 0.5; a linear schedule of (2M + 1)² episodes, 20 successes in"
                " a row. The order of the actions is right, left, down, up: for task B the first leads away from the"
                " goal.",
                "Converged: the greedy policy solves 95 % of the unsatisfied cells within 4M steps, by an exact check"
                " of every cell after each 1 % of the episodes. As in the paper-like learner, its ties go to the first"
                " action; so **half of the table of task A is solved without having been learned**, where the first"
                " action leads to the goal's column. The column *however ties go* counts a cell only if all of its best"
                " actions lead to the goal.",
                "Episodes begin in the cells of verified scenes: 12 for every cell on average, drawn by the exact"
                " sampler from the band of phi of each level, the same for all seeds; uniform scenes follow the base"
                " distribution. *Model*: the levels' scenes are an energy model's, refined and verified.",
                "CPU seconds are those of one thread, on a machine that had other work to do, without the drawing of"
                " scenes.",
            ]
        ),
    ]


def corridors(found: Found, largest: int) -> str:
    """What the best curriculum for a one-step learner does."""
    at = _largest(found, largest)
    strict = [_short(mean(at["fig5 fair", "A", name], "any_episodes")) for name in ("corridors", "self-paced")]
    return (
        "*Corridors* is our best curriculum for the one-step learner on A: along the goal's column, then along every"
        f" {GAP}th row on one side, from the column outwards, then the cells between; then the other side. A one-step"
        " learner learns a cell when it comes from there to cells that it knows, and one more whenever a random action"
        " takes it off its way and back; long ways along unknown cells teach it most. It begins with the side that the"
        " first action does not solve by itself, and so owes much of its advantage to the check: however ties go, it"
        f" needs {strict[0]} episodes, self-paced {strict[1]}."
    )


def sources(found: Found, largest: int) -> str:
    """How a model's scenes do."""
    at = _largest(found, largest)
    parts = []
    for name in ("paper-like", "fair"):
        for task in ("A", "B"):
            exact, model = (mean(at[f"fig5 {name}", task, which], "episodes") for which in MODELS)
            parts.append(f"{name}, {task}: {_short(exact)} and {_short(model)}")
    return f"Self-paced with scenes of the exact sampler and of the model needs {'; '.join(parts)} episodes."


MODELS = ("self-paced", "self-paced, model")


def beyond(bound: int, largest: int) -> str:
    """What the rows of the last table are."""
    return (
        f"The bound: a tabular learner knows nothing of cells it has not been in, and an episode has {4 * largest}"
        f" steps, so 95 % of the cells take {bound} episodes at least. *Backward replay* learns an episode from its"
        " last step to its first. A *map* keeps every outcome it saw and plans on it; where the map ends it tries what"
        " it has not tried (in the manner of R-max). *Knows the way back*: it finds out which action undoes which, and"
        " from then on enters every step in both directions. *Straight on*: it goes on in its direction until it meets"
        " a cell that it knows. *Relations* is no longer a table of cells, so the bound does not bind it: cells that"
        " are left of, level with or right of the plate, and below, level or above, share their values, nine rows in"
        " all; *growing range* goes on to the next level after every success."
    )


def strategies() -> str:
    """How the compiled curricula and the general ones relate."""
    return (
        "The strategies for any learner (`scenegen.curriculum.strategies`), in Python, with the fair one-step learner."
        " They know phi and outcomes, nothing of cells. The compiled linear and self-paced curricula above are theirs"
        " with levels as wide as a cell, without the share of uniform scenes and the patience, and with all cells of"
        " the two newest levels drawn alike; corridors is not one of them, since it looks at cells instead of phi."
    )


def bars(found: Found, largest: int) -> list[str]:
    """The project's bars, met or not."""
    at = _largest(found, largest)
    lines = []
    for task, least in (("A", TWENTY), ("B", FIFTEEN)):
        base = mean(at["fig5 paper-like", task, "uniform"], "episodes")
        paced = mean(at["fig5 paper-like", task, "self-paced"], "episodes")
        times = 0.0 if base is None or not paced else base / paced
        lines.append(
            f"Paper-like, task {task}: self-paced needs {times:.1f} times fewer episodes than uniform; at least"
            f" {least:g}: {_met(times >= least)}."
        )
    rows = grouped([pair for pair in found if pair[0].group == "beyond"], lambda case: case.name)
    lines.append(
        _best(rows, [name for name in rows if name.startswith(STEPWISE)], "Fair, A, one-step", FAIR, FAIR_GOAL)
    )
    tabular = [name for name in rows if not name.startswith("relations")]
    lines.append(_best(rows, tabular, "Any tabular learner of ours, A", ANY_LEARNER, ANY_GOAL))
    return lines


def _best(rows: dict[str, list[Record]], names: list[str], words: str, bar: int, goal: int) -> str:
    parts = []
    for what, how in (("episodes", "ties to the first action"), ("any_episodes", "however ties go")):
        means = {name: value for name in names if (value := mean(rows[name], what)) is not None}
        if not means:
            parts.append(f"none, {how}")
            continue
        best = min(means, key=lambda name: means[name])
        parts.append(
            f"{means[best]:,.0f} ({best}; {how}; bar {_met(means[best] <= bar)}, goal {_met(means[best] <= goal)})"
        )
    return f"{words}: at most {bar:,}, goal {goal:,}: {', '.join(parts)}."


def _largest(found: Found, largest: int) -> dict[tuple[str, str, str], list[Record]]:
    def by(case: Case) -> tuple[str, str, str]:
        return case.group, case.task, case.name

    return grouped([pair for pair in found if pair[0].size == largest], by)


def _met(yes: bool) -> str:
    return "met" if yes else "missed"


def _short(value: float | None) -> str:
    return "never" if value is None else short(value)
