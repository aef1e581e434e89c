"""`settle=True`: scenes that stay put for a simulated second, put between a plan and its run."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from scenegen.api.ask import Ask
from scenegen.errors import Diagnostic, RequestError
from scenegen.needs import need

if TYPE_CHECKING:
    from scenegen.render.settle import Refusals
    from scenegen.sampling.auto import Choice


def check_settle(wanted: bool) -> None:
    """Before any work is done: raises RequestError where scenes are to settle and pybullet is not installed."""
    if wanted:
        need("pybullet", "to settle scenes")


@contextmanager
def settling(
    asked: Ask, choice: Choice, workers: int | None, wanted: bool
) -> Iterator[tuple[Choice, int | None, Refusals | None]]:
    """The choice to run, on how many processes, and what will count the scenes that did not settle.

    Where settling is wanted, the processes do the dropping: drawing scenes takes a thousandth of that time.
    """
    if not wanted or not choice.plan.reached:
        yield choice, workers, None
        return
    from scenegen.render.settle import Refusals, Settler
    from scenegen.render.settling import Settling

    spec = asked.problem.spec
    refusals = Refusals(spec.objects)
    with Settler(spec.shapes, fixed=tuple(spec.fixed), workers=workers) as settler:
        yield dataclasses.replace(choice, plan=Settling(choice.plan, settler, refusals)), 1, refusals


def told(warnings: tuple[Diagnostic, ...], refusals: Refusals | None) -> tuple[Diagnostic, ...]:
    """The warnings of a run and of its settling."""
    refused = None if refusals is None else refusals.diagnostic()
    return warnings if refused is None else (*warnings, refused)


def blamed(shortfall: Diagnostic | None, refusals: Refusals | None) -> Diagnostic | None:
    """A shortfall that also says how many scenes did not settle."""
    if shortfall is None or refusals is None or not refusals.refused:
        return shortfall
    note = f"{shortfall.note}; {refusals.summary()}" if shortfall.note else refusals.summary()
    return dataclasses.replace(shortfall, note=note)


def refuse_model() -> RequestError:
    title = "scenes of a model cannot be settled"
    return RequestError(Diagnostic(title, help="sample from the spec, or leave --settle out"))
