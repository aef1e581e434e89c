"""A fit: how often a policy succeeds in each task of a suite, predicted from the start. Format `scenegen/fit`, version
2."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, FiniteFloat

from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import SceneSet
from scenegen.arrays import Array
from scenegen.errors import RequestError
from scenegen.errors.learning import MODEL_OF_ANOTHER_SPEC
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.success.features import fingerprint, measure_features
from scenegen.learn.success.files import BLANK_DIGEST, FileModel, OutcomesHeader, dump_with_digest, load_with_digest
from scenegen.learn.success.logistic import Logistic
from scenegen.learn.success.measures import Interval
from scenegen.scenes.files import write_whole
from scenegen.scenes.sets import Sha256
from scenegen.validation import as_path

COIN_AUC = 0.5  # the AUC of a score that tells nothing
VAGUE_WIDTH = 0.5  # of an interval of an AUC that says next to nothing


class HeldOut(FileModel):
    """How good predictions are at starts that the fit has not seen: measures with their 95 % intervals. `by_chance` is
    the calibration error that perfect predictions would show in so few episodes, on the average and in 5 % of cases;
    `auc_of_phi` is what phi alone tells."""

    calibration_error: FiniteFloat
    by_chance: tuple[FiniteFloat, FiniteFloat]
    brier: Interval
    auc: Interval
    auc_of_phi: Interval


class TaskFit(FileModel):
    """The fit of a task, whose label `success` is success; `digest` is the fingerprint of what predictions follow from.
    `base_rate` is the success rate of its base distribution, with a 95 % interval, by the bands of the suite.
    There is no `held_out` where all episodes ended alike: no measure tells anything there."""

    name: str
    success: str
    digest: Sha256
    episodes: int
    starts: int
    base_rate: Interval
    model: Logistic
    held_out: HeldOut | None

    def predict(self, spec: CheckedSpec, rows: Array) -> Array:
        """The success rate in scenes with the rows of the spec's core, (3M, B) -> (B,)."""
        features, values = measure_features(spec, self.success, rows)
        return self.model([one.name for one in features], values)

    @property
    def findings(self) -> list[str]:
        """Where phi, or all that is measured, does not tell what it should, in words."""
        if self.held_out is None:
            return [f"nothing can be told of success in {self.name}: all {self.episodes} episodes ended alike"]
        mine, (phi, low, high) = self.held_out.auc, self.held_out.auc_of_phi
        sentences = []
        if low <= COIN_AUC:
            what = "phi does not predict success" if high >= COIN_AUC else "success is more frequent where phi is lower"
            what = "it cannot be told whether phi predicts success" if high - low > VAGUE_WIDTH else what
            sentences.append(f"{what} in {self.name}: AUC {phi:.2f}, 95 % interval {low:.2f} to {high:.2f}")
        if low <= COIN_AUC <= high and mine[1] <= COIN_AUC and mine[2] - mine[1] <= VAGUE_WIDTH:
            said = "AUC {:.2f}, 95 % interval {:.2f} to {:.2f}".format(*mine)
            sentences.append(f"nothing measured at the start predicts success in {self.name}: {said}")
        return sentences


class Fit(FileModel):
    """How often a policy succeeds in the tasks of a suite; `run` says which, and in which world."""

    format: Literal["scenegen/fit"] = "scenegen/fit"
    version: Literal[2] = 2
    digest: Sha256 = BLANK_DIGEST
    run: OutcomesHeader
    monotone: bool
    tasks: Annotated[tuple[TaskFit, ...], Field(min_length=1)]

    @staticmethod
    def load(path: str | Path) -> Fit:
        """The fit in a file. Raises DataError."""
        return load_with_digest(Fit, as_path("fit", path), "a fit", "a fit of outcomes")

    def save(self, path: str | Path) -> None:
        """Write the fit as JSON; the file appears whole or not at all. Raises OutputError."""
        write_whole(as_path("out", path), dump_with_digest(self))

    def task_of(self, spec: CheckedSpec) -> TaskFit:
        """The task of a spec: same objects, workspace and success formula, whatever it requires. Raises RequestError
        for other specs."""
        for task in self.tasks:
            if task.success in spec.labels and task.digest == fingerprint(spec, task.success):
                return task
        raise RequestError(MODEL_OF_ANOTHER_SPEC(spec=spec.name, fitted=tuple(one.name for one in self.tasks)))

    def predict(self, scenes: SceneSet) -> Array:
        """The success rate that is predicted at each of n scenes, (n,). Raises RequestError for scenes of others."""
        spec = scenes.header.spec.checked_spec
        return self.task_of(spec).predict(spec, rows_of(spec, scenes))
