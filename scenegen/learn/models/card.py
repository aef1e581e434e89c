"""The metadata of a model file, as pydantic models: what the model is, what it was trained on, and how. No torch."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, model_validator

from scenegen.geometry.workspace import Workspace
from scenegen.lang.formula.core import Core, gate, read_rows
from scenegen.lang.spec import CheckedSpec
from scenegen.pose import is_angle, row_count
from scenegen.scenes.data import SpecRef, WorkspaceData

# Which coordinates a network has to learn, and which it need not: read off the core formula.


Row = Annotated[int, Field(ge=0, lt=30_000)]


class Layout(BaseModel):
    """What fixes the sizes of a network.

    `positions` and `angles` are the rows of (3N, B) storage on which phi or the requirement depends. All other rows
    are free: the base distribution has them uniform whatever phi is, so nothing about them is to be learnt. `branches`
    counts the ways in which phi is decided (scenegen.learn.models.codec). `partial`: phi of some labels can be left out
    of the network's input, which then says which.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    objects: int = Field(ge=1, le=10_000)
    labels: int = Field(ge=1, le=10_000)
    positions: tuple[Row, ...] = ()
    angles: tuple[Row, ...] = ()
    branches: int = Field(default=1, ge=1, le=4096)
    partial: bool = False

    @model_validator(mode="after")
    def _agree(self) -> Self:
        rows = [*self.positions, *self.angles]
        if len(set(rows)) != len(rows) or any(row >= row_count(self.objects) for row in rows):
            raise ValueError("a row occurs twice or is of no object")
        return self

    @property
    def coordinates(self) -> int:
        """Learnt coordinates of a scene: one a position, two (cosine and sine) an angle."""
        return len(self.positions) + 2 * len(self.angles)

    @property
    def condition_size(self) -> int:
        """Inputs of a network for the labels: two for each, three where a label may be left out."""
        return (3 if self.partial else 2) * self.labels

    @property
    def noise(self) -> int:
        """Random numbers that a scene needs: one a learnt position or angle."""
        return len(self.positions) + len(self.angles)


def layout_of(core: Core, branches: int = 1) -> Layout:
    """The layout of a spec's core formula."""
    rows = depends_on(core)
    return Layout(
        objects=len(core.objects),
        labels=len(core.labels),
        positions=tuple(row for row in rows if not is_angle(row)),
        angles=tuple(row for row in rows if is_angle(row)),
        branches=branches,
        partial=len(core.labels) > 1,
    )


def depends_on(core: Core) -> list[int]:
    """The rows of (3N, B) storage that some label or the requirement reads, in order."""
    return sorted(read_rows(gate(core)))


# The card.


MODEL_FORMAT = "scenegen/model"

Name = Annotated[str, Field(min_length=1, max_length=1000)]
Setting = bool | int | FiniteFloat | str | None


class _StrictCardModel(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class SpecData(SpecRef):
    """The spec a model was trained on: as in scene files, and where it was read from."""

    name: str


class LabelData(_StrictCardModel):
    """A label and the range of its phi in the training data, in metres and radians."""

    name: Name
    lowest: FiniteFloat
    highest: FiniteFloat


class LossData(_StrictCardModel):
    """Mean losses of some epochs, evenly chosen, the last one among them (epochs count from 1)."""

    epochs: list[int] = Field(max_length=1000)
    means: dict[Name, list[FiniteFloat]]


class DataData(_StrictCardModel):
    """The scenes behind a model: how many trained it, how many were held out, and the checksum of them all."""

    scenes: int = Field(ge=1)
    held_out: int = Field(ge=1)
    sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]


class ValidationData(_StrictCardModel):
    """Of some epochs, the last and the kept one among them (epochs count from 1): the mean of |phi - wanted phi| of
    each label at held-out labels, in metres and radians, and the energy score (scenegen.learn.training.session)."""

    epochs: list[int] = Field(max_length=1001)
    errors: dict[Name, list[FiniteFloat]]
    scores: list[FiniteFloat]

    @model_validator(mode="after")
    def _agree(self) -> Self:
        if any(len(values) != len(self.epochs) for values in (self.scores, *self.errors.values())):
            raise ValueError("not one figure for each epoch")
        return self


class QualityData(_StrictCardModel):
    """Measured when training was done, at some wanted values of one label or two (scenegen.learn.evaluation.card):
    the mean of |phi - wanted phi|; coverage, and that of other exact scenes (`truth`); KS, sliced KS and energy
    distance; the share of the scenes that meet what the spec requires."""

    wanted: dict[Name, FiniteFloat]
    error: FiniteFloat
    coverage: FiniteFloat
    truth: FiniteFloat
    ks: FiniteFloat
    sliced: FiniteFloat
    energy: FiniteFloat
    required: FiniteFloat


class RangeData(_StrictCardModel):
    """The scenes that `sample` returns for ranges of phi, low and high, None where there is no end, against exact ones:
    coverage, and that of other exact scenes (`truth`); KS of the phi that is furthest off, and of the worst coordinate;
    sliced KS and energy distance."""

    wanted: dict[Name, tuple[FiniteFloat | None, FiniteFloat | None]]
    phi: FiniteFloat
    coverage: FiniteFloat
    truth: FiniteFloat
    ks: FiniteFloat
    sliced: FiniteFloat
    energy: FiniteFloat


class ModelCard(_StrictCardModel):
    """What a model file says about itself. `hyper` are the model's own settings, `training` the training's. Where
    training was told to keep the best epoch, `kept_epoch` is the one whose weights these are; else it was the last.
    `corrected`: the last step of a scene is the spec's (scenegen.learn.models.correction). `quality` is
    empty until the model has been measured, and `ranges` is None; files of earlier versions have no `ranges`.

    `recipe` is `default`. Earlier versions had others, whose networks have names of their own now, and files of version
    0.1 name no recipe, no layout, no data and no validation.
    """

    scenegen: str
    model: Name
    recipe: Name = "paper"
    layout: Layout | None = None
    hyper: dict[Name, Setting]
    spec: SpecData
    workspace: WorkspaceData
    objects: list[Name] = Field(min_length=1, max_length=10_000)
    labels: list[LabelData] = Field(min_length=1, max_length=10_000)
    training: dict[Name, Setting | dict[Name, Setting]]
    epochs_done: int = Field(ge=0)
    losses: LossData
    data: DataData | None = None
    validation: ValidationData | None = None
    kept_epoch: Annotated[int, Field(ge=1)] | None = None
    corrected: bool = False
    quality: list[QualityData] = Field(default=[], max_length=1000)
    ranges: list[RangeData] | None = Field(default=None, max_length=1000)

    @model_validator(mode="after")
    def _agree(self) -> Self:
        labels = [label.name for label in self.labels]
        if len(set(labels)) != len(labels) or len(set(self.objects)) != len(self.objects):
            raise ValueError("a name occurs twice")
        layout = self.layout
        if layout is not None and (layout.objects < len(self.objects) or layout.labels != len(labels)):
            raise ValueError("the layout is of another number of objects or labels")
        if any(label.lowest > label.highest for label in self.labels):
            raise ValueError("a label's range is reversed")
        if not (self.workspace.x[0] < self.workspace.x[1] and self.workspace.y[0] < self.workspace.y[1]):
            raise ValueError("the workspace is empty")
        return self

    @property
    def sizes(self) -> Layout:
        """The layout, also of a file that has none."""
        return self.layout or Layout(objects=len(self.objects), labels=len(self.labels))

    @property
    def area(self) -> Workspace:
        """The workspace, as everything else takes it."""
        return Workspace(x=self.workspace.x, y=self.workspace.y)


def spec_data(spec: CheckedSpec) -> SpecData:
    # a file's name is bytes, and those that are no text are written as escapes
    name = spec.name.encode(errors="backslashreplace").decode()
    return SpecData(name=name, title=spec.title, source=spec.source, sha256=spec.sha256)
