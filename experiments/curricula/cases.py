"""What is run: a learner, a curriculum, a task, a size, a seed, as plain data."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

from experiments.tabular.choose import LINEAR, LINES, SELF_PACED, UNIFORM, Curriculum
from experiments.tabular.grid import ORDER
from experiments.tabular.model import HARDEST, NEW, Explorer
from experiments.tabular.qlearning import Learner

PLATE = "object plate at (0.5, 0.5, 0)\n"
TASKS = {  # the paper's; the plate stands in the middle of the table, on which nothing else can be learned
    "A": f"object mug\n{PLATE}task: closeTo(mug, plate, 0)\n",
    "B": f"object spoon\n{PLATE}task: leftOf(spoon, plate) & belowOf(spoon, plate)\n",
}
RELATIONS = f"object mug\n{PLATE}left: leftOf(mug, plate)\nbelow: belowOf(mug, plate)\n"
WORDS = {"A": "closeTo(mug, plate, 0)", "B": "leftOf & belowOf(spoon, plate)"}
EXACT, MODEL = "exact sampler", "trained model"
SETTINGS = ("paper-like", "fair")
PLAIN, BY_LOT, NO_LOTS = "as in Fig. 5", "ties by lot", "ties to the first action"  # what is changed
GAP = 9  # rows between corridors
UNIFORMLY = Curriculum(UNIFORM)


@dataclass(frozen=True, slots=True)
class Case:
    """A run. `group` is the part of the report that it belongs to and `name` its row or curve there; `learner` decides
    what a step teaches and `curriculum` where episodes begin, an Explorer both. `rows` learns values for relations
    instead of cells. `both` goes on until the policy is right however ties are decided. `strategy` names one of
    scenegen.play.strategies, with `options`, instead of `curriculum`."""

    group: str
    name: str
    task: str
    size: int
    seed: int
    learner: Learner | Explorer
    curriculum: Curriculum = UNIFORMLY
    source: str = EXACT
    order: tuple[str, ...] = ORDER
    relations: bool = False
    both: bool = False
    most: int = 60_000_000  # episodes
    strategy: str = ""
    options: tuple[tuple[str, float], ...] = ()


def paper_like(size: int) -> Learner:
    """Ties go to the first action, three actions in ten are random, small steps."""
    return Learner(alpha=0.1, gamma=0.95, epsilon=0.3, lots=False, limit=4 * size)


def fair(size: int) -> Learner:
    """Ties are decided by lot, one action in ten is random, large steps: moves and table do not change."""
    return Learner(alpha=0.5, gamma=0.95, epsilon=0.1, lots=True, limit=4 * size)


def curricula(setting: str, size: int) -> dict[str, Curriculum]:
    """The three of Fig. 5, each with the settings that suit it."""
    if setting == "paper-like":
        length, streak = 6 * size**3, 40
    else:
        length, streak = (2 * size + 1) ** 2, 20
    return {
        "uniform": Curriculum(UNIFORM),
        "linear": Curriculum(LINEAR, length=length, band=1),
        "self-paced": Curriculum(SELF_PACED, streak=streak),
    }


def figure5(sizes: tuple[int, ...], seeds: tuple[int, ...]) -> Iterator[Case]:
    """Both settings, the three curricula with the exact sampler's scenes, self-paced once more with a model's; the
    fair setting's corridors."""
    for setting in SETTINGS:
        for task in TASKS:
            for size in sizes:
                learner = paper_like(size) if setting == "paper-like" else fair(size)
                shown = curricula(setting, size)
                for seed in seeds:
                    blank = Case(f"fig5 {setting}", "", task, size, seed, learner, both=setting == "fair")
                    for name, curriculum in shown.items():
                        yield replace(blank, name=name, curriculum=curriculum)
                    # a model that leaves cells out may never get there: this is five times what true scenes need
                    drawn = replace(blank, source=MODEL, most=50 * (2 * size + 1) ** 2)
                    yield replace(drawn, name="self-paced, model", curriculum=shown["self-paced"])
                    if setting == "fair" and task == "A":
                        yield replace(blank, name="corridors", curriculum=Curriculum(LINES))


def sensitivity(size: int, seeds: tuple[int, ...]) -> Iterator[Case]:
    """One thing changed at a time, in both settings."""
    for setting in SETTINGS:
        plain = paper_like(size) if setting == "paper-like" else fair(size)
        shown = curricula(setting, size)
        first = ("left", "right", "down", "up")  # for task B, left and down lead towards the goal
        both = ("left", "down", "right", "up")
        changes: list[tuple[str, str, Learner, tuple[str, ...]]] = [
            (PLAIN, "A", plain, ORDER),
            (NO_LOTS if plain.lots else BY_LOT, "A", plain._replace(lots=not plain.lots), ORDER),
            *((f"epsilon {epsilon:g}", "A", plain._replace(epsilon=epsilon), ORDER)
              for epsilon in (0.03, 0.1, 0.3, 0.5) if epsilon != plain.epsilon),
            *((f"alpha {alpha:g}", "A", plain._replace(alpha=alpha), ORDER)
              for alpha in (0.1, 0.5, 1.0) if alpha != plain.alpha),
            *((f"{limit}M steps an episode", "A", plain._replace(limit=limit * size), ORDER) for limit in (2, 8)),
            ("task B", "B", plain, ORDER),
            ("task B, first action leads to the goal", "B", plain, first),
            ("task B, first two actions lead to the goal", "B", plain, both),
        ]  # fmt: skip
        for words, task, learner, order in changes:
            for seed in seeds:
                for name, curriculum in shown.items():
                    group = f"sensitivity {setting}: {words}"
                    most = 400 * (2 * size + 1) ** 2
                    yield Case(group, name, task, size, seed, learner, curriculum, order=order, most=most)
        for share in (0.25, 0.5, 1.0, 2.0, 4.0):
            length = round(share * shown["linear"].length)
            for seed in seeds:
                schedule = Curriculum(LINEAR, length=length, band=1)
                yield Case(f"schedule {setting}", f"{share:g}", "A", size, seed, plain, schedule)
        for streak in (5, 10, 20, 40, 80):
            for seed in seeds:
                paced = Curriculum(SELF_PACED, streak=streak)
                yield Case(f"streak {setting}", f"{streak}", "A", size, seed, plain, paced, most=3_000_000)


def beyond(size: int, seeds: tuple[int, ...]) -> Iterator[Case]:
    """Learners that make more of an episode, on task A."""
    one, limit = fair(size), 4 * size
    replayed = one._replace(replay=True)
    uniform, paced, quick = Curriculum(UNIFORM), Curriculum(SELF_PACED, streak=20), Curriculum(SELF_PACED, streak=1)
    rows: list[tuple[str, Learner | Explorer, Curriculum, bool]] = [
        ("one step, uniform", one, uniform, False),
        ("one step, self-paced", one, paced, False),
        ("one step, corridors", one, Curriculum(LINES), False),
        ("backward replay, uniform", replayed, uniform, False),
        ("backward replay, self-paced", replayed, paced, False),
        ("backward replay, self-paced, impatient", replayed, Curriculum(SELF_PACED, streak=2, band=4), False),
        ("map, uniform", Explorer(False, False, limit), uniform, False),
        ("map that knows the way back, uniform", Explorer(False, True, limit), uniform, False),
        ("map that knows the way back, new cells", Explorer(False, True, limit, NEW), uniform, False),
        ("the same, straight on, hardest new cells", Explorer(True, True, limit, HARDEST), uniform, False),
        ("relations, uniform", one, uniform, True),
        ("relations, growing range", one, quick, True),
        ("relations, backward replay, uniform", replayed, uniform, True),
        ("relations, backward replay, growing range", replayed, quick, True),
    ]
    for name, learner, curriculum, relations in rows:
        for seed in seeds:
            yield Case(
                "beyond", name, "A", size, seed, learner, curriculum, relations=relations, both=True, most=500_000
            )


def strategies(size: int, levels: int, seeds: tuple[int, ...]) -> Iterator[Case]:
    """Every strategy that any learner can use, with the fair learner on task A; those that know levels with one as wide
    as a cell."""
    from scenegen.play.strategies import STRATEGIES

    cells = (2 * size + 1) ** 2
    known: dict[str, tuple[tuple[str, float], ...]] = {
        "ordered": (("levels", levels), ("scenes", cells)),
        "linear": (("levels", levels), ("episodes", cells)),
        "self_paced": (("levels", levels), ("window", 20), ("rate", 1.0), ("share", 0.0)),
        "reverse": (("levels", levels),),
    }
    for name in STRATEGIES:
        for seed in seeds:
            yield Case(
                "strategies", name, "A", size, seed, fair(size), most=10 * cells, both=True,
                strategy=name, options=known.get(name, ()),
            )  # fmt: skip
