"""The table of experiments. A new one is one module and one line here."""

from __future__ import annotations

import importlib
from dataclasses import dataclass
from typing import TYPE_CHECKING

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_CHOICE

if TYPE_CHECKING:
    from experiments.plan import Plan
    from experiments.report import Report

ALL = "all"


@dataclass(frozen=True, slots=True)
class Entry:
    """Where an experiment's function is, what it shows, about how long that takes on two cores, and which seeds it
    takes unless told otherwise: `first` to `seeds` - 1."""

    function: str
    about: str
    time: str
    seeds: int = 3
    first: int = 0

    def run(self, plan: Plan) -> Report:
        """Carry it out. Raises ScenegenError for whatever stands in its way."""
        module, _, name = self.function.partition(":")
        found: Report = getattr(importlib.import_module(module), name)(plan)
        return found


# Text, not functions: `python -m experiments --help` lists them without importing torch.
EXPERIMENTS: dict[str, Entry] = {
    "semantics": Entry("experiments.semantics:run", "phi while a mug moves round a plate", "10 seconds"),
    "exp1": Entry("experiments.exp1:run", "a mug to the upper left of a plate, two labels", "15 minutes"),
    "exp2": Entry("experiments.exp2:run", "a table set for one, rare", "15 minutes"),
    "exp3": Entry("experiments.exp3:run", "3, 5 and 7 blocks in order", "60 minutes"),
    "unseen": Entry("experiments.unseen.report:run", "specs that nobody tuned on; --seeds A:B", "2 hours", 1040, 1000),
    "unseen-games": Entry(
        "experiments.unseen.report:run_games", "the same by gan and aae, spec by spec", "2 hours", 1040, 1000
    ),
    "unseen-labels": Entry("experiments.unseen.report:run_labels", "any one or two labels of twelve", "5 minutes", 1),
    "unseen-named": Entry("experiments.unseen.report:run_named", "the paper's specs, and three more", "8 minutes", 1),
    "rejection": Entry("experiments.rejection:run", "draws per scene, by every sampler", "2 minutes"),
    # its networks are those of exp1 and exp2
    "space": Entry("experiments.space:run", "look-up tables against networks and specs", "1 minute"),
    "curriculum": Entry("experiments.curriculum:run", "Q-learning with scenes by phi", "15 minutes", 5),
    "curriculum-deep": Entry("experiments.curriculum_deep:run", "two and four objects, learnt by PPO", "10 minutes"),
}


def chosen(name: str) -> dict[str, Entry]:
    """The experiments that a name stands for, in the order of the table. Raises RequestError for an unknown one."""
    if name == ALL:
        return EXPERIMENTS
    if name not in EXPERIMENTS:
        known = [*EXPERIMENTS, ALL]
        raise RequestError(UNKNOWN_CHOICE(what="experiment", name=name, known=known))
    return {name: EXPERIMENTS[name]}
