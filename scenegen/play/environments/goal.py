"""The goal of an episode: the spec's labels, and which of them have to be satisfied."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from gymnasium import error

from scenegen.api.spec import Spec, load, parse
from scenegen.arrays import Array
from scenegen.errors import ScenegenError, quote_names
from scenegen.errors.requests import MISSING_ARGUMENT, UNKNOWN_LABEL, WRONG_VALUE
from scenegen.geometry import MATH, NUMPY
from scenegen.lang.formula.core import Core, Junction, gate
from scenegen.lang.formula.interpret import phi
from scenegen.lang.spec import CheckedSpec, members_of
from scenegen.play.environments.gym_errors import as_names, gym_error


def load_spec(spec: Spec | str | Path | None) -> Spec:
    """A spec as users give it: a Spec, the path of a file, or a text. Raises gymnasium.error.MissingArgument for None,
    gymnasium.error.Error, with the diagnostics, for one with mistakes."""
    if spec is None:
        question = 'say what the table is about: spec="leftOf(mug, plate)", or the path of a spec file'
        raise gym_error(MISSING_ARGUMENT(argument="spec", question=question), error.MissingArgument)
    if isinstance(spec, Spec):
        return spec
    try:
        if isinstance(spec, Path) or (
            isinstance(spec, str) and "\n" not in spec and spec.rstrip().lower().endswith(".spec")
        ):
            return load(spec)
        if isinstance(spec, str):
            return parse(spec)
    except ScenegenError as problem:
        raise error.Error(str(problem)) from problem
    wanted = "a Spec, the path of a spec file or its text"
    raise gym_error(WRONG_VALUE(argument="spec", value=f"of type {type(spec).__name__}", wanted=wanted))


@dataclass(frozen=True, slots=True)
class Goal:
    """`spec` is the given spec; if several labels have to be satisfied, it has one more label, the last: their minimum.
    `names` are its D labels, `goal` is the number of the label that is satisfied at the end of a successful episode,
    `labels` counts the labels of the given spec, and `wanted` are those that have to be satisfied."""

    spec: Spec
    names: tuple[str, ...]
    goal: int
    labels: int
    wanted: tuple[str, ...]


def make_goal(spec: Spec, goal: str | Sequence[str] | None) -> Goal:
    """`goal` names the labels to satisfy, all of them if it is None. Raises gymnasium.error.Error for unknown ones."""
    wanted = spec.labels if goal is None else as_names("goal", goal, "a label")
    for name in wanted:
        if name not in spec.labels:
            raise gym_error(UNKNOWN_LABEL(name=name, known=spec.labels))
    if not wanted:
        usage = f"a label, {quote_names(spec.labels)}, or leave it out"
        raise gym_error(WRONG_VALUE(argument="goal", value="empty", wanted=usage))
    if len(wanted) == 1:
        return Goal(spec, spec.labels, spec.labels.index(wanted[0]), len(spec.labels), wanted)
    whole = _with_goal(spec.require_scenes(), wanted)
    members = tuple(_with_goal(one, wanted) for one in spec.require_scenes().members)
    labels = whole.labels
    return Goal(Spec(dataclasses.replace(whole, members=members)), labels, len(labels) - 1, len(spec.labels), wanted)


def _with_goal(spec: CheckedSpec, wanted: Sequence[str]) -> CheckedSpec:
    """The spec with one more label, the minimum of the wanted ones."""
    core = spec.core
    together = Junction("min", tuple(core.labels[name] for name in wanted))
    labels = {**core.labels, " & ".join(wanted): len(core.nodes)}
    return dataclasses.replace(spec, core=dataclasses.replace(core, nodes=(*core.nodes, together), labels=labels))


class Scorer:
    """phi of all D labels of a goal; the last of the R rows is the requirement's, if there is one.

    One scene is scored by plain Python: some 6 microseconds for a small spec, where torch takes 100 and numpy 9.
    """

    def __init__(self, target: Goal) -> None:
        self._members = members_of(target.spec.require_scenes())
        self._cores: tuple[Core, ...] = tuple(gate(one.core) for one in self._members.specs)
        self.requires = any(one.core.requirement is not None for one in self._members.specs)

    def __call__(self, rows: Array) -> Array:
        """(3N, B) -> (R, B). Rows of objects that are not there are NaN."""
        if len(self._cores) == 1:
            return self._score(self._cores[0], rows)
        found = np.full((len(self._members.specs[0].labels) + self.requires, rows.shape[1]), np.inf)
        for member, which in self._members.split(rows):
            values = self._score(self._cores[member], rows[self._members.rows[member][:, None], which])
            found[: len(values), which] = values  # a member that requires nothing leaves the last row infinite
        return found

    def _score(self, core: Core, rows: Array) -> Array:
        count = rows.shape[1]
        if count == 1:
            values = phi(core, rows[:, 0].tolist(), MATH)
            return np.array(list(values.values()))[:, None]
        values = phi(core, list(rows), NUMPY)
        return np.stack([np.broadcast_to(value, count) for value in values.values()])
