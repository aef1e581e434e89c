"""Trained models: a model together with its spec, read from a file."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from scenegen.api.request import any_model
from scenegen.api.spec import LearnedModel, Spec, check_spec, load
from scenegen.arrays import Array
from scenegen.errors import DataError, Diagnostic, RequestError
from scenegen.errors.learning import (
    BEYOND_TRAINING,
    MODEL_OF_ANOTHER_SPEC,
    NO_MODEL_OF_NUMBER,
    NO_TABLE_OF_PHI,
    NOT_MEASURED,
    RAW_BREAKS_REQUIREMENT,
)
from scenegen.errors.requests import MISSING_ARGUMENT
from scenegen.geometry import NUMPY
from scenegen.lang.formula.core import REQUIRE, gate
from scenegen.lang.formula.interpret import phi as score
from scenegen.lang.spec import CheckedSpec, file_stem, members_of, numbers_text
from scenegen.needs import need
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.files import ensure_folder, write_whole
from scenegen.validation import as_path

if TYPE_CHECKING:
    from scenegen.learn.models.checkpoint import TrainedModel


class Model(LearnedModel):
    """A trained model together with the spec that it was trained on (the model file carries both)."""

    def __init__(self, trained: TrainedModel) -> None:
        self.trained = trained
        self.spec = Spec(trained.spec)

    def __repr__(self) -> str:
        card = self.trained.card
        return f"<Model {card.model} of {card.spec.name}, {card.epochs_done} epochs>"

    @property
    def members(self) -> tuple[tuple[dict[str, int], Model], ...]:
        """The model for each combination of numbers of things, where its spec draws any; else itself, of no numbers."""
        return (({}, self),)

    def member_of(self, checked: CheckedSpec) -> Model:
        """The model of a spec with these numbers of things, one of `members`."""
        return self

    @property
    def name(self) -> str:
        """What kind of model it is, e.g. "gan"."""
        return self.trained.name

    def proposer_of(self, checked: CheckedSpec, ranges: Mapping[str, Range]) -> TrainedModel:
        """What proposes scenes of a spec with these numbers of things, asked for ranges of phi."""
        return replace(self.member_of(checked).trained, only=tuple(ranges))

    def advice(self, request: SampleRequest, rows: npt.NDArray[np.float64] | None) -> tuple[Diagnostic, ...]:
        """Warnings about scenes (3N, n) that it made for a request; None where they are no longer in memory."""
        return advice(self, request.phi, rows, request.raw)

    def with_counts(self, counts: Mapping[str, int | str]) -> Model:
        """The model of these numbers of things, by name. Raises RequestError as `Spec.with_counts` does: a model of
        fixed numbers draws none."""
        self.spec.with_counts(counts)
        return self

    def with_spec(self, spec: Spec) -> Model:
        """The same model, to draw scenes of its spec with labels added after its own."""
        other = copy.copy(self)
        other.spec = spec
        return other

    def in_steps(self, steps: int) -> Model:
        """The same model, taking `steps` evaluations of its network for a scene: for a flow, which is trained once and
        taken in any number. Raises RequestError for models that have no such choice, and beyond 1 to 1,000."""
        other = copy.copy(self)
        other.trained = self.trained.in_steps(steps)
        return other


def read_model(path: Path, spec: Spec | None = None) -> Model:
    """Read a model file. Raises DataError for anything but a whole one, and for one of another spec than `spec`."""
    need("torch", "to read a model file")
    from scenegen.learn.models.checkpoint import load_model

    return Model(load_model(path, None if spec is None else spec.checked))


# Models of a spec that draws how many things there are, or which: a folder with an ordinary model for each
# combination of numbers.
#
# The number of things does not depend on what phi is wanted, so the models get the shares that the members of the spec
# have in the exact samplers (scenegen.sampling.families). Nothing about the shares has to be learned.


SPEC = "numbers.spec"  # the spec that draws numbers, in a folder of models


class ModelFamily(Model):
    """Models by the numbers of things in their scenes. What is asked of one model is answered by that of the most
    things; scenes come from all."""

    def __init__(self, spec: Spec, members: Mapping[str, Model]) -> None:
        """`members` are the models by the SHA-256 of their specs."""
        self.spec = spec
        self._members = dict(members)
        self.trained = list(self._members.values())[-1].trained

    def __repr__(self) -> str:
        return f"<ModelFamily {self.name} of {self.spec.definition.name}, {len(self._members)} models>"

    @property
    def members(self) -> tuple[tuple[dict[str, int], Model], ...]:
        return tuple((numbers, self.member_of(member.checked)) for numbers, member in self.spec.members)

    def member_of(self, checked: CheckedSpec) -> Model:
        return self._members[checked.sha256]

    def with_counts(self, counts: Mapping[str, int | str]) -> Model:
        """The models of these numbers of things, by name; with all of them one model. Raises RequestError as
        `Spec.with_counts` does."""
        spec = self.spec.with_counts(counts)
        if not spec.counts:
            return self.member_of(spec.checked)
        return ModelFamily(spec, {one.checked.sha256: self.member_of(one.checked) for _, one in spec.members})

    def in_steps(self, steps: int) -> ModelFamily:
        """The same models, each taking `steps` evaluations of its network for a scene. Raises RequestError as
        `Model.in_steps` does."""
        return ModelFamily(self.spec, {key: one.in_steps(steps) for key, one in self._members.items()})

    def with_spec(self, spec: Spec) -> ModelFamily:
        """Models of labels that are added to their specs, for a spec that draws the same numbers."""
        pairs = zip(spec.members, self.members, strict=True)
        other = copy.copy(self)
        other.spec = spec
        other._members = {one.checked.sha256: model.with_spec(one) for (_, one), (_, model) in pairs}
        return other


def is_family(path: Path) -> bool:
    """Whether a path is a folder of models; what no path can be called is none."""
    try:
        return (path / SPEC).is_file()
    except (OSError, ValueError):
        return False


def model_file(path: Path, numbers: Mapping[str, int]) -> Path:
    """The file of these numbers of things in a folder of models; of no numbers `path` itself, a model file."""
    return path / f"{file_stem(numbers)}.safetensors" if numbers else path


ANY = "any"  # stands for the model of any spec where the path of a model does


def load_model(path: str | Path, spec: Spec | None = None) -> Model:
    """Read a model file, or a folder of models of a spec that draws numbers of things; "any" is the model of any spec
    and needs `spec`. Raises DataError for anything but a whole one, and for one of another spec than `spec`."""
    if spec is not None:
        check_spec(spec)
    if str(path) == ANY:
        if spec is None:
            raise RequestError(MISSING_ARGUMENT(argument="spec", question='of which spec? load_model("any", spec)'))
        made = any_model(spec)
        assert isinstance(made, Model)
        return made
    found = as_path("path", path)
    return _load_family(found, spec) if is_family(found) else read_model(found, spec)


def _load_family(path: Path, spec: Spec | None) -> ModelFamily:
    """Raises DataError, also where a model is missing."""
    found = load(path / SPEC)
    if spec is not None and spec.definition.sha256 != found.definition.sha256:
        raise DataError(MODEL_OF_ANOTHER_SPEC(folder=path, spec=spec.definition.name))
    members: dict[str, Model] = {}
    for numbers, member in found.members:
        file = model_file(path, numbers)
        if not file.exists():
            raise DataError(NO_MODEL_OF_NUMBER(path=file, counted=numbers_text(numbers)))
        members[member.checked.sha256] = read_model(file, member)
    return ModelFamily(found, members)


def family_files(spec: Spec, folder: Path) -> list[tuple[dict[str, int], Spec, Path]]:
    """The numbers, spec and file of every model of a folder, whose spec is written. Raises OutputError."""
    ensure_folder(folder)
    write_whole(folder / SPEC, spec.source.encode())
    return [(numbers, member, model_file(folder, numbers)) for numbers, member in spec.members]


# Notes and warnings about a model's scenes, from the figures measured when it was trained.


def advice(model: Model, ranges: Mapping[str, Range], rows: Array | None, raw: bool) -> tuple[Diagnostic, ...]:
    """Warnings about scenes (3N, n) that a model made for a request; None where they are no longer in memory."""
    from scenegen.learn.faults import (  # most requests are not of models
        covers_request,
        faults,
        overlapping,
        relevant_quality,
    )

    ends = {label: (wanted.low, wanted.high) for label, wanted in ranges.items()}
    found = dict[Diagnostic, None]()
    scenes = [None] * len(model.members) if rows is None or not raw else _scenes_of(model, rows)
    for (numbers, one), made in zip(model.members, scenes, strict=True):
        card = one.trained.card
        mine = faults(relevant_quality(card.quality, ranges), () if raw else overlapping(card, ranges))
        if ranges and card.ranges is not None and not covers_request(card, one.trained.regions, ranges):
            where = [f"{label}={wanted}" for label, wanted in ranges.items()]
            mine.append(NOT_MEASURED(where=" ".join(where), one=where[0] if len(where) == 1 else None))
        if not one.trained.regions and not all(wanted.is_bounded for wanted in ranges.values()):
            mine.append(NO_TABLE_OF_PHI(version=card.scenegen))
        if raw:
            mine += targets_beyond_training(one, ends)
            mine += [] if made is None else unmet_requirements(one, made)
        found |= dict.fromkeys(each.but(counted=numbers_text(numbers)) if numbers else each for each in mine)
    return tuple(found)


def _scenes_of(model: Model, rows: Array) -> list[Array]:
    """The scenes (3N, n) by the model that made them: of each member's things alone, (3N', n')."""
    if not model.spec.counts:
        return [rows]
    members = members_of(model.spec.definition)
    found = dict(members.split(rows))
    none = np.empty(0, dtype=np.intp)
    return [rows[np.ix_(mine, found.get(number, none))] for number, mine in enumerate(members.rows)]


def targets_beyond_training(model: Model, ends: Mapping[str, tuple[float | None, float | None]]) -> list[Diagnostic]:
    """Targets outside of the range of phi that the model was trained on."""
    lines = []
    for label, (low, high) in ends.items():
        least, most = model.trained.label_ranges.get(label, (-np.inf, np.inf))
        if (low is not None and low < least) or (high is not None and high > most):
            lines.append(BEYOND_TRAINING(label=label, low=least, high=most))
    return lines


def unmet_requirements(model: Model, rows: Array) -> list[Diagnostic]:
    """Raw scenes that break a requirement."""
    core = gate(model.spec.checked.core)
    if REQUIRE not in core.labels:
        return []
    broken = int((np.broadcast_to(score(core, list(rows), NUMPY)[REQUIRE], rows.shape[1]) < 0.0).sum())
    if not broken:
        return []
    return [RAW_BREAKS_REQUIREMENT(broken=broken, count=rows.shape[1])]
