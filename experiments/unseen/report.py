"""The reports on random specs: every figure's median, worst decile and worst row, and the bars."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from experiments.errors import CHANGED_RECORD
from experiments.jobs import share
from experiments.page import table
from experiments.plan import Plan
from experiments.report import Report, short
from experiments.unseen.named import NAMED
from experiments.unseen.queries import PATIENCE
from experiments.unseen.runs import LABELS, Job, Row, Run, kept, perform
from scenegen.errors import DataError

MODEL, GAMES = "flow", ("gan", "aae")
FIGURES: dict[str, tuple[Callable[[Row], float | None], bool]] = {  # and whether more is better
    "error of phi, raw": (lambda row: row.error, False),
    "coverage, raw": (lambda row: row.coverage, True),
    "KS, raw": (lambda row: row.ks, False),
    "sliced KS, raw": (lambda row: row.sliced, False),
    "energy distance, raw": (lambda row: row.energy, False),
    "meets what is required, raw": (lambda row: row.required, True),
    "coverage, returned": (lambda row: row.returned, True),
    "error of phi, network alone": (lambda row: row.alone[0] if row.alone else None, False),
    "meets what is required, network alone": (lambda row: row.alone[1] if row.alone else None, True),
    "truth: coverage": (lambda row: row.true_coverage, True),
    "truth: KS": (lambda row: row.true_ks, False),
    "truth: sliced KS": (lambda row: row.true_sliced, False),
    "truth: energy distance": (lambda row: row.true_energy, False),
}
BARS: tuple[tuple[str, Callable[[Row], bool], float], ...] = (
    ("raw error <= 0.01 in 90 %", lambda row: row.error <= 0.01, 0.9),
    ("raw error <= 0.03 in all", lambda row: row.error <= 0.03, 1.0),
    ("raw coverage >= 0.85 in 80 %", lambda row: row.coverage >= 0.85, 0.8),
    ("raw coverage >= 0.90 in 90 %", lambda row: row.coverage >= 0.9, 0.9),
    ("raw coverage >= 0.75 in all", lambda row: row.coverage >= 0.75, 1.0),
    ("KS <= 0.12 in 90 %", lambda row: row.ks <= 0.12, 0.9),
    ("sliced KS <= 0.12 in 90 %", lambda row: row.sliced <= 0.12, 0.9),
    ("returned: coverage >= 0.92 in 90 %", lambda row: (row.returned or 0.0) >= 0.92, 0.9),
    ("goal: raw coverage >= 0.95 in 95 %", lambda row: row.coverage >= 0.95, 0.95),
)


def run(plan: Plan) -> Report:
    """The plan's seeds are those of the specs. Raises ScenegenError."""
    both = [(seed, training) for training in range(plan.trainings) for seed in plan.seeds]
    return _report(plan, both, (MODEL,), "unseen", "Specs that nobody tuned on")


def run_games(plan: Plan) -> Report:
    """The same for the adversarial models, spec by spec. Raises ScenegenError."""
    both = [(seed, training) for training in range(plan.trainings) for seed in plan.seeds]
    return _report(plan, both, GAMES, "unseen-games", "GAN and AAE on specs that nobody tuned on")


def run_labels(plan: Plan) -> Report:
    """One spec with twelve labels, asked for any one of them and for pairs; the plan's seeds are those of trainings.
    Raises ScenegenError."""
    both = [(LABELS, training) for training in plan.seeds]
    return _report(plan, both, (MODEL,), "unseen-labels", "Some labels of twelve")


def run_named(plan: Plan) -> Report:
    """The specs of the paper's experiments, and three more; the plan's seeds are those of trainings. Raises
    ScenegenError."""
    folder = str(plan.cache().folder)
    both = [(which, training) for training in plan.seeds for which in NAMED]
    done = _run(plan, [Job(0, MODEL, plan.quick, folder, plan.epochs, training, which) for which, training in both])
    runs = list(done.values())
    blocks = {"rows": _targets(runs), "specs": _specs(runs), "missing": _missing(runs)}
    return Report("unseen-named", "Specs one by one", blocks, _data(plan, done))


def _report(plan: Plan, seeds: Sequence[tuple[int, int]], models: Sequence[str], name: str, title: str) -> Report:
    """Blocks of several models have the model's name in front."""
    folder = str(plan.cache().folder)
    done = _run(
        plan,
        [Job(seed, model, plan.quick, folder, plan.epochs, training) for seed, training in seeds for model in models],
    )
    blocks: dict[str, str] = {}
    for model in models:
        runs = [run for job, run in done.items() if job.model == model]
        before = f"{model}-" if len(models) > 1 else ""
        blocks |= {
            f"{before}scope": _scope(runs, len(seeds)),
            f"{before}figures": _figures(runs),
            f"{before}bars": _bars(runs),
            f"{before}specs": _specs(runs),
            f"{before}missing": _missing(runs),
        }
    return Report(name, title, blocks, _data(plan, done))


def _data(plan: Plan, done: Mapping[Job, Run]) -> dict[str, object]:
    return {"epochs": plan.epochs, "runs": [{"model": job.model, **run.model_dump()} for job, run in done.items()]}


def _run(plan: Plan, jobs: list[Job]) -> dict[Job, Run]:
    """What the jobs found, done now where that is not kept; of what is kept only, where the plan says so."""
    missing = [job for job in jobs if kept(job) is None]
    if plan.kept:
        jobs = [job for job in jobs if job not in missing]
    elif missing:
        share(missing, plan, perform, "trained and measured")
    return {job: _whole(job) for job in jobs}


def _scope(runs: Sequence[Run], planned: int) -> str:
    """How much was run, and how much of it could not be measured."""
    by_seed = Counter(run.training_seed for run in runs)
    rows, missing = len(_rows(runs)), sum(len(run.missing) for run in runs)
    done = ", ".join(f"{count} with training seed {seed}" for seed, count in sorted(by_seed.items())) or "none"
    failed = sum(bool(run.failed) for run in runs)
    return (
        f"{len(runs)} of {planned} runs: {done}. {failed} of them have no model. {rows} targets were measured; "
        f"for {missing} more no exact scenes were found within {PATIENCE:g} CPU seconds."
    )


def _missing(runs: Sequence[Run]) -> str:
    """What could not be measured, and why."""
    lines = [
        [_name(run), why.replace("|", "\\|")] for run in runs for why in ([run.failed] if run.failed else run.missing)
    ]
    return table(["spec", "not measured"], lines) if lines else "Nothing is missing."


def _name(run: Run) -> str:
    """The spec of a run, and the training's seed where that is not 0."""
    which = run.name or str(run.seed)
    return f"{which}, seed {run.training_seed}" if run.training_seed else which


def _targets(runs: Sequence[Run]) -> str:
    """Every target by itself, with what true scenes have in brackets."""
    lines = []
    for run in runs:
        for row in run.rows:
            wanted = ", ".join(f"{value:.4g}" for value in row.wanted.values())
            both = [(row.coverage, row.true_coverage), (row.ks, row.true_ks), (row.sliced, row.true_sliced)]
            returned = "-" if row.returned is None else f"{row.returned:.3f}"
            alone = "-" if row.alone is None else f"{row.alone[0]:.3f}; {row.alone[1]:.2f}"
            figures = [f"{row.error:.4f}", *(f"{made:.3f} ({true:.3f})" for made, true in both), returned, alone]
            lines.append([_name(run), wanted, *figures])
    head = ["spec", "wanted", "error", "coverage", "KS", "sliced KS", "coverage, returned"]
    return table([*head, "network alone: error; meets what is required"], lines)


def _whole(job: Job) -> Run:
    found = kept(job)
    if found is None:
        raise DataError(CHANGED_RECORD(path=job.name))
    return found


def _rows(runs: Sequence[Run]) -> list[Row]:
    return [row for run in runs for row in run.rows]


def _figures(runs: Sequence[Run]) -> str:
    lines = []
    for name, (value, more) in FIGURES.items():
        found = np.array([number for row in _rows(runs) if (number := value(row)) is not None])
        if len(found):
            tail, worst = (np.quantile(found, 0.1 if more else 0.9), found.min() if more else found.max())
            lines.append([name, *(f"{number:.4f}" for number in (np.median(found), tail, worst))])
    return table(["", "median", "worst decile", "worst row"], lines)


def _bars(runs: Sequence[Run]) -> str:
    """The bars, with what part of all rows or runs meets each; of several training seeds also the least and the most
    that one of them has, on the specs that all have."""
    each = _alike(runs)
    several = len(each) > 1
    lines = []
    for name, enough, count in _all_bars():
        part = count(runs) or 0.0
        parts = [part_ for some in each if (part_ := count(some)) is not None]
        spread = f"{100.0 * min(parts):.1f} % to {100.0 * max(parts):.1f} %" if len(parts) > 1 else "-"
        lines.append([name, f"{100.0 * part:.1f} %", "yes" if part >= enough else "no", *[spread] * several])
    specs = len({run.seed for run in each[0]}) if several else 0
    return table(["bar", "met by", "held", *[f"each of {len(each)} training seeds, on {specs} specs"] * several], lines)


def _all_bars() -> list[tuple[str, float, Callable[[Sequence[Run]], float | None]]]:
    """Name, the share that has to meet it, and what share of some runs does; None where none was measured."""

    def of_rows(met: Callable[[Row], bool]) -> Callable[[Sequence[Run]], float | None]:
        return lambda runs: _share([met(row) for row in _rows(runs)])

    def of_runs(met: Callable[[Run], bool], known: Callable[[Run], object]) -> Callable[[Sequence[Run]], float | None]:
        return lambda runs: _share([met(run) for run in runs if not run.failed and known(run)])

    return [
        *((name, enough, of_rows(met)) for name, met, enough in BARS),
        ("training under 300 CPU s", 1.0, of_runs(lambda run: run.cpu_seconds < 300.0, lambda run: True)),
        ("file under 1 MB", 1.0, of_runs(lambda run: run.size < 1_000_000, lambda run: True)),
        ("raw scenes >= 50,000 a CPU second", 1.0, of_runs(lambda run: run.speed >= 50_000.0, lambda run: run.speed)),
    ]


def _share(met: Sequence[bool]) -> float | None:
    return sum(met) / len(met) if met else None


def _alike(runs: Sequence[Run]) -> list[list[Run]]:
    """The runs of each training seed, on the specs that all of them have."""
    trainings = sorted({run.training_seed for run in runs})
    specs = [{(run.seed, run.name) for run in runs if run.training_seed == seed} for seed in trainings]
    common = set.intersection(*specs) if specs else set()
    return [[run for run in runs if run.training_seed == seed and (run.seed, run.name) in common] for seed in trainings]


def _specs(runs: Sequence[Run]) -> str:
    lines = []
    for run in runs:
        first = [_name(run), str(run.objects), str(run.labels), str(len(run.rows)), str(len(run.missing))]
        if run.failed or not run.rows:
            lines.append([*first, *["-"] * 7])
            continue
        worst = [max(row.error for row in run.rows), min(row.coverage for row in run.rows)]
        far = [max(row.ks for row in run.rows), max(row.sliced for row in run.rows)]
        figures = [f"{worst[0]:.4f}", f"{worst[1]:.3f}", f"{far[0]:.3f}", f"{far[1]:.3f}"]
        cost = [f"{run.cpu_seconds:.0f}", f"{run.size / 1e3:.0f}", short(run.speed) if run.speed else "-"]
        lines.append([*first, *figures, *cost])
    head = ["spec", "objects", "labels", "rows", "too rare", "error", "coverage", "KS", "sliced KS"]
    return table([*head, "training, CPU s", "file, kB", "raw scenes/s"], lines)
