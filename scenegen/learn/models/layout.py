"""Which coordinates a network has to learn, and which it need not: read off the core formula."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from scenegen.lang.formula.core import Core, gated, read_rows
from scenegen.pose import is_angle, row_count

Row = Annotated[int, Field(ge=0, lt=30_000)]


class Layout(BaseModel):
    """What fixes the sizes of a network.

    `positions` and `angles` are the rows of (3N, B) storage on which phi or the requirement depends. All other rows
    are free: the base distribution has them uniform whatever phi is, so nothing about them is to be learnt. `branches`
    counts the ways in which phi is decided (scenegen.learn.models.codec). The published networks know neither and take
    every row: they have no positions, no angles and one branch. `partial`: phi of some labels can be left out of the
    network's input, which then says which.
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
    def told(self) -> int:
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
    return sorted(read_rows(gated(core)))
