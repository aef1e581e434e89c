"""`scenegen fit`: what of a start predicts whether a policy succeeds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.cli.options import argument, option
from scenegen.cli.output import detail, print_columns, print_error

if TYPE_CHECKING:
    from scenegen.learn.success.fit import TaskFit
    from scenegen.learn.success.measures import Interval


HEADS = ("task", "episodes", "base rate", "AUC of phi", "AUC", "Brier", "calibration error", "by chance", "reads")


def fit(
    outcomes: list[Path] = argument("Outcomes of one policy, as `scenegen suite run` writes them.", "OUTCOMES..."),
    suite: Path = option("The suite that they are of.", "DIR", default=...),
    out: Path = option("The file of the fit.", "FILE", default=...),
    monotone: bool = option("The predicted rate never falls as phi or a margin of the success formula rises."),
) -> None:
    """Fit a policy's success to what can be measured at the start: does phi predict it?

    \b
      scenegen fit mine.jsonl --suite tabletop --out policy.fit
      scenegen fit a.jsonl b.jsonl --suite mine/ --out p.fit --monotone
      scenegen sample my.spec --success 0.4:0.6 --under policy.fit

    Of each task: logistic regression on phi and the margins of the success formula, how crowded the table is, distances
    and places. Which of these take part, and how strongly they are drawn to 0, is chosen by cross-validation. How good
    the predictions are is measured at starts that the fit has not seen.

    `base rate` is the success rate of the base distribution: of each band of the suite, weighted by its probability.
    AUC is the probability that a success has a higher value than a failure: 0.5 tells nothing, 1 everything. The
    calibration error is the mean difference of predicted and true rates; `by chance` is what perfect predictions would
    show in so few episodes: on the average, and at most in 95 % of cases. Intervals are of 95 %.
    """
    from scenegen.play.fit import fit_outcomes
    from scenegen.scenes.files import check_writable
    from scenegen.scenes.formats.registry import check_ending

    check_writable(out)
    check_ending(out, ".fit")
    found = fit_outcomes(outcomes, suite, monotone=monotone)
    detail(f"fitted {len(found.tasks)} tasks of {found.run.suite}")
    found.save(out)
    print_error(f"{found.run.policy} in {found.run.world}; the fit is in {out}")
    print_columns(HEADS, [_row(one) for one in found.tasks])
    for finding in (line for one in found.tasks for line in one.findings):
        print_error(finding)


def _row(one: TaskFit) -> tuple[str, ...]:
    held, told = one.held_out, ["-"] * 5
    if held is not None:
        chance = "{:.3f}, at most {:.3f}".format(*held.by_chance)
        told = [*map(_interval, (held.auc_of_phi, held.auc, held.brier)), f"{held.calibration_error:.3f}", chance]
    return one.name, f"{one.episodes:,}", _interval(one.base_rate), *told, one.model.reads


def _interval(value: Interval) -> str:
    return "{:.2f} ({:.2f}..{:.2f})".format(*value)
