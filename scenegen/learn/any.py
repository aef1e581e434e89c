"""The model of any spec: what the weights that come with the package are for one spec.

They learnt from the formulas of many random specs and have seen none of the user's. So what the card of a trained model
tells from its training is found out on the spot: how far phi of each label goes, how phi is distributed where it is
asked for, and how the scenes compare there with exact ones.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import torch

from scenegen.api.spec import Spec, refuse_choices
from scenegen.arrays import Array
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.learning import NOT_MEASURED, POOR_MODEL
from scenegen.errors.requests import NO_TIME_TO_CHECK
from scenegen.lang.formula.core import gate
from scenegen.lang.spec import CheckedSpec
from scenegen.learn import guided
from scenegen.learn.evaluation.card import CpuBudget, sample_model
from scenegen.learn.evaluation.fidelity import fidelity
from scenegen.learn.faults import FAULTS_SHOWN, LEAST_COVERAGE, MOST_DISTANCE
from scenegen.learn.model import ANY, Model, targets_beyond_training, unmet_requirements
from scenegen.learn.models.card import LabelData, LossData, ModelCard, depends_on, layout_of, spec_data
from scenegen.learn.models.checkpoint import TrainedModel, as_trained
from scenegen.learn.models.codec import ways_of
from scenegen.learn.models.graph import refuse_unknown
from scenegen.learn.models.graph_flow import WEIGHTS, GraphHyper, shipped_weights
from scenegen.learn.training.balanced import reach
from scenegen.processes.pool import one_thread
from scenegen.resources import __version__
from scenegen.sampling.plan import Plan
from scenegen.sampling.plans import SELECTIONS, draw
from scenegen.sampling.problem import Problem, make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.data import WorkspaceData
from scenegen.search.effort import Budget, StoppedError

ANY_SCOPE = {
    "takes": "formulas over centres, headings and footprints: any objects, held or free, regions, heights of fixed "
    "surfaces, `require`, quantifiers",
    "does not take": "specs over time, numbers of things that are drawn, one of several surfaces",
}
EXACT_SEED = 20_261_127  # of the exact scenes that it is compared with, and of its own
COMPARED_SCENES = 400  # of each
MIN_COMPARED_SCENES = 100  # that a comparison needs
EXACT_SECONDS = 0.5  # CPU seconds for the exact ones
COMMON, LEFT_OUT = 0.05, 0.2  # share of a branch among exact scenes; of that share, below which it counts as left out


class AnyModel(Model):
    """The model of any spec, for one. Raises RequestError for a spec over time, one that draws numbers of things, and
    one in which things stand on one of several surfaces; also where the time of `budget`, which is that of all that it
    does, is over before phi is known."""

    def __init__(self, spec: Spec, budget: Budget | None = None) -> None:
        refuse_choices(spec, "the model of any spec")
        limit = budget or Budget(math.inf)
        self._budget = CpuBudget(limit.seconds, limit.started)
        try:
            super().__init__(bind_weights(spec.checked, self._budget))
        except StoppedError:
            raise RequestError(NO_TIME_TO_CHECK()) from None
        self.spec = spec
        self._known: dict[tuple[object, ...], dict[str, tuple[Array, Array]]] = {}

    def __repr__(self) -> str:
        return f"<AnyModel of {self.spec.definition.name}>"

    def proposer_of(self, checked: CheckedSpec, ranges: Mapping[str, Range]) -> TrainedModel:
        _, phi = self._exact(SampleRequest(dict(ranges), COMPARED_SCENES, EXACT_SEED, spread="base", workers=1))
        phi = (
            phi if phi.shape[1] == COMPARED_SCENES else phi[:, :0]
        )  # how many a machine finds in time changes no scene
        ends = np.array([ranges.get(label, Range()).ends for label in self.spec.labels])
        regions = (np.concatenate([ends, phi], axis=1),) if phi.shape[1] else ()
        return replace(self.trained, only=tuple(ranges), regions=regions)

    @one_thread()
    def advice(self, request: SampleRequest, rows: npt.NDArray[np.float64] | None) -> tuple[Diagnostic, ...]:
        """What a comparison with exact scenes shows; where its own are few, selected or not in memory, some are made
        for it."""
        found = []
        if request.raw:
            found += targets_beyond_training(self, {label: one.ends for label, one in request.phi.items()})
            found += [] if rows is None else unmet_requirements(self, rows)
        asked = SampleRequest(
            request.phi, COMPARED_SCENES, EXACT_SEED, spread=request.spread, fix=request.fix, workers=1
        )
        exact, _ = self._exact(asked)
        selected = request.raw or any(getattr(request, option) for option in SELECTIONS)
        if rows is None or rows.shape[1] < COMPARED_SCENES or selected:
            try:
                rows = sample_model(self, asked, replace(self._budget.portion(EXACT_SECONDS), firm=False))[0]
            except (RequestError, StoppedError):
                rows = exact[:, :0]
        where = " ".join(f"{label}={one}" for label, one in request.phi.items()) or "any phi"
        count = min(exact.shape[1], rows.shape[1], COMPARED_SCENES)
        if count < MIN_COMPARED_SCENES:
            return (*found, NOT_MEASURED(where=where, one=None))
        some = np.random.default_rng(EXACT_SEED).permutation(rows.shape[1])[:count]
        return (*found, *compare_scenes(self.spec.checked, exact[:, :count], rows[:, some], where))

    def _exact(self, request: SampleRequest) -> tuple[Array, Array]:
        """See `exact_scenes`; those that were not found in time, spread in one way, are not looked for in another."""
        known = self._known.setdefault((*sorted(request.phi.items()), *sorted(request.fix.items())), {})
        if request.spread not in known:
            rare = next((found for found in known.values() if not found[1].shape[1]), None)
            known[request.spread] = rare or exact_scenes(self.spec.checked, request, self._budget)
        return known[request.spread]


def exact_scenes(checked: CheckedSpec, request: SampleRequest, limit: CpuBudget | None = None) -> tuple[Array, Array]:
    """Exact scenes (3N, n) for a request, and their phi (L, n), in random order: as many as there are in time."""
    budget = (limit or CpuBudget(math.inf)).portion(EXACT_SECONDS)
    try:
        found = draw(make_problem(checked, request, budget), budget)
    except (RequestError, StoppedError):
        return np.empty((len(checked.box()[0]), 0)), np.empty((len(checked.labels), 0))
    order = np.random.default_rng(EXACT_SEED).permutation(found.count)
    return found.rows[:, order], found.phi[: len(checked.labels), order]


def compare_scenes(spec: CheckedSpec, exact: Array, made: Array, where: str) -> list[Diagnostic]:
    """Warnings, where scenes (3N, n) that were made are unlike exact ones."""
    figures = fidelity(exact, made, depends_on(spec.core))
    found = []
    if figures.coverage < LEAST_COVERAGE or figures.ks > MOST_DISTANCE:
        found.append(POOR_MODEL(unlike=f"cover {figures.coverage:.2f}, KS {figures.ks:.2f} at {where}"))
    missing = left_out(spec, exact, made)
    return [*found, POOR_MODEL(branches=missing, where=where)] if missing else found


def make_plan(problem: Problem, budget: Budget) -> Plan:
    """The plan of a problem by the model of its spec. Raises RequestError."""
    proposer = AnyModel(Spec(problem.spec), budget).proposer_of(problem.spec, problem.request.phi)
    return guided.make_plan(problem, budget, proposer)


def left_out(spec: CheckedSpec, exact: Array, made: Array) -> str:
    """The atoms that decide phi of a label in a good part of exact scenes (3N, n), and hardly ever in those that were
    made, as text."""
    found = []
    ways = [ways_of(spec, torch.from_numpy(rows).float()).numpy() for rows in (exact, made)]
    for place, label in enumerate(spec.labels):
        shares = [{int(atom): float((one[place] == atom).mean()) for atom in np.unique(one[place])} for one in ways]
        for atom, share in shares[0].items():
            mine = shares[1].get(atom, 0.0)
            if share >= COMMON and mine < LEFT_OUT * share:
                text = getattr(spec.core.nodes[atom], "text", label)
                found.append(f"`{text}` decides `{label}` in {mine:.0%} of them, in {share:.0%} of exact ones")
    return "; ".join(found[:FAULTS_SHOWN])


def bind_weights(checked: CheckedSpec, budget: CpuBudget) -> TrainedModel:
    """The weights that come with the package, as a model of this spec. Raises RequestError where phi of a label cannot
    vary, and StoppedError where time is up."""
    card, weights = shipped_weights()
    refuse_unknown(checked, gate(checked.core), GraphHyper.model_validate(card.hyper).primitives)
    ends = {label: _reach(checked, label, budget) for label in checked.labels}
    space = checked.workspace
    found = ModelCard(
        scenegen=__version__,
        model=ANY,
        recipe="default",
        layout=layout_of(checked.core),
        hyper=dict(card.hyper),
        spec=spec_data(checked),
        workspace=WorkspaceData(x=space.x, y=space.y),
        objects=list(checked.objects),
        labels=[LabelData(name=label, lowest=low, highest=high) for label, (low, high) in ends.items()],
        training={"steps": card.steps, "specs": card.specs, "seed": card.seed},
        epochs_done=0,
        losses=LossData(epochs=[], means={}),
        corrected=True,
    )
    low, high = torch.tensor(list(ends.values()), dtype=torch.float32).T
    tensors = {f"networks.{name}": weight for name, weight in weights.items()}
    return as_trained(found, {**tensors, "label_lowest": low, "label_highest": high}, WEIGHTS, stop=budget)


def _reach(checked: CheckedSpec, label: str, budget: CpuBudget) -> tuple[float, float]:
    """The lowest and the highest phi of a label among exact scenes. Raises RequestError where it cannot vary, and
    StoppedError where time is up."""
    budget.check()
    _, phi = exact_scenes(
        checked, SampleRequest({label: Range(None, None)}, COMPARED_SCENES, EXACT_SEED, workers=1), budget
    )
    mine = phi[checked.labels.index(label)]
    if len(mine) < COMPARED_SCENES or mine.min() == mine.max():  # not what a machine found in time
        return reach(checked, EXACT_SEED, budget, budget.ends)[label]
    return float(mine.min()), float(mine.max())
