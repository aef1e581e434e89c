"""Specs that are looked at one by one: those of the paper's experiments, and three on which `energy` failed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from experiments.problems import PROBLEMS
from experiments.unseen.queries import HALF, SHARE, Ends, Query
from scenegen.api.spec import Spec, parse

Targets = Sequence[Mapping[str, float]]

PAIRS = ", ".join(f"a{number}, b{number}" for number in range(1, 6))
EACH = " & ".join(f"closeTo(a{k}, b{k}, 15 cm) & leftOf(a{k}, b{k})" for k in range(1, 6))
TEXTS: Mapping[str, str] = {
    "either": "(leftOf(fork, plate) | aboveOf(fork, plate))"
    " & !closeTo(fork, plate, 0.15) & closeTo(spoon, fork, 0.3)\n",
    "pairs": f"object {PAIRS}\ntask: {EACH}\n",
    "between": "require noOverlap()\ntask: between(mug, plate, bowl, 3 cm) & farFrom(plate, bowl, 30 cm)\n",
}
TARGETS: Mapping[str, Sequence[float]] = {
    "either": (-0.2, 0.0, 0.06),
    "pairs": (-0.3, -0.1, 0.01),
    "between": (-0.1, 0.0, 0.01),
}
ALSO: Mapping[str, Targets] = {"exp1": [{"task": -0.4, "safe": 0.3}]}  # of several pieces
NAMED = (*TEXTS, *PROBLEMS)


def named_spec(name: str) -> Spec:
    """The spec of this name in NAMED."""
    return PROBLEMS[name].load() if name in PROBLEMS else parse(TEXTS[name], f"{name}.spec")


def named_queries(name: str, spec: Spec, reach: Ends) -> list[Query]:
    """What its model is asked for. `reach` has the ends of each label's phi."""
    half = {label: min(HALF, SHARE * (high - low)) for label, (low, high) in reach.items()}
    if name in PROBLEMS:
        targets = [PROBLEMS[name].wanted, *ALSO.get(name, ())]
    else:
        targets = [{spec.labels[0]: value} for value in TARGETS[name]]
    return [Query(wanted, half) for wanted in targets]
