"""Scenes labelled with phi."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass

import torch
from torch import Tensor

from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import TOO_FEW_SCENES, TOO_RARE_TO_TRAIN
from scenegen.lang.formula.core import gate
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.codec import Codec
from scenegen.learn.robustness import Robustness
from scenegen.learn.training.gathering import Gathering
from scenegen.pose import row_count
from scenegen.sampling.prior import pull_back
from scenegen.sampling.request import Range

_DRAWN_AT_ONCE = 65_536
MAX_FRUITLESS_DRAWS = 1_000_000  # uniform scenes without which, on average, one that meets what is required must not go


@dataclass(frozen=True, slots=True)
class Dataset:
    """M scenes: `rows` (3N, M) float32, metres and radians, in the workspace; `phi` (L, M) float32, a row per label.

    The rows are those of the core: after the objects come the switches of choices.

    `balanced` (M,) int64 says which labels decided how often such scenes occur: the index of one label, EVERY, or NONE,
    where the scenes follow the base distribution (None: all do). Among scenes with the same phi of these labels, others
    are free as in the base distribution; where these labels are left out, they are not.

    `regions` are ranges of phi and the phi (L, m) of scenes there as they occur; none where all scenes are as they
    occur, or as a file has them.
    """

    objects: tuple[str, ...]
    labels: tuple[str, ...]
    rows: Tensor
    phi: Tensor
    balanced: Tensor | None = None
    regions: tuple[tuple[dict[str, Range], Tensor], ...] = ()

    def __len__(self) -> int:
        return self.rows.shape[1]

    def take(self, which: Tensor | slice) -> Dataset:
        """Some of the scenes."""
        rows, phi = self.rows[:, which].contiguous(), self.phi[:, which].contiguous()
        balanced = None if self.balanced is None else self.balanced[which]
        return Dataset(self.objects, self.labels, rows, phi, balanced, self.regions)

    @property
    def positives(self) -> float:
        """Share of the scenes that satisfy every label (phi >= 0)."""
        return float((self.phi >= 0.0).all(dim=0).double().mean())

    @property
    def sha256(self) -> str:
        """Checksum of poses and labels: two data sets with the same one are bit-equal."""
        digest = hashlib.sha256(self.rows.numpy().tobytes())
        digest.update(self.phi.numpy().tobytes())
        return digest.hexdigest()


def base_draw(
    spec: CheckedSpec, scenes: int, generator: torch.Generator, found_so_far: Callable[[int], None] | None = None
) -> Tensor:
    """(3N, scenes) float32 from the base distribution: uniform over workspace and circle, but for priors; objects that
    are held in their place, what is required met. `found_so_far` gets their number. Raises RequestError where that is
    met too rarely for plain draws."""
    if spec.core.requirement is None:
        return _free_draw(spec, scenes, generator)
    spec_loss = Robustness(gate(spec.core))
    kept, found, tried = [torch.empty(row_count(len(spec.core.objects)), 0)], 0, 0
    while found < scenes:
        if tried >= MAX_FRUITLESS_DRAWS and found * MAX_FRUITLESS_DRAWS < tried:
            raise RequestError(TOO_RARE_TO_TRAIN(found=found, tried=tried))
        rows = _free_draw(spec, _DRAWN_AT_ONCE, generator)
        kept.append(rows[:, spec_loss.rows(rows)[-1] >= 0.0])
        found, tried = found + kept[-1].shape[1], tried + _DRAWN_AT_ONCE
        if found_so_far is not None:
            found_so_far(min(found, scenes))
    return torch.cat(kept, dim=1)[:, :scenes].contiguous()


def _free_draw(spec: CheckedSpec, scenes: int, generator: torch.Generator) -> Tensor:
    unit = torch.rand(scenes, row_count(len(spec.core.objects)), generator=generator)
    rows = held_in_place(spec, Codec(spec.workspace, len(spec.core.objects)).decode(unit))
    if not spec.priors:
        return rows
    _, base = pull_back(spec, *spec.box())
    return torch.from_numpy(base.poses(rows.double().numpy())).to(rows)


def held_in_place(spec: CheckedSpec, rows: Tensor) -> Tensor:
    """The scenes (3N, B), changed where the spec holds objects in their place."""
    lowest, highest = spec.box()
    held = torch.from_numpy((lowest == highest).nonzero()[0])
    rows[held] = torch.from_numpy(lowest).to(rows)[held, None]
    return rows


def label_scenes(spec: CheckedSpec, rows: Tensor) -> Dataset:
    """The scenes with their phi."""
    return Dataset(spec.objects, spec.labels, rows, Robustness(spec.core).rows(rows))


def uniform(spec: CheckedSpec, scenes: int, generator: torch.Generator, gathering: Gathering | None = None) -> Dataset:
    """`scenes` scenes, uniform over the workspace and the circle."""
    gathering = gathering or Gathering()
    gathering.begin("gathering scenes", scenes)
    return label_scenes(spec, base_draw(spec, scenes, generator, gathering.reach))


# Held-out scenes: which of a data set never train.


MAX_HELD_OUT = 2048  # scenes that are held out at most: the mean error is then known to some percent
HELD_OUT_DIVISOR = 10  # one scene in so many, where that is fewer


def held_count(scenes: int) -> int:
    """How many scenes are held out beside, or of, that many."""
    return min(MAX_HELD_OUT, max(1, scenes // HELD_OUT_DIVISOR))


def held_places(total: int, held: int) -> Tensor:
    """(held,) int64 indices of the held-out scenes among `total`, evenly spread and ascending: file order may mean
    something. Raises DataError where nothing would be left to train on."""
    if not 0 < held < total:
        raise DataError(TOO_FEW_SCENES(count=total))
    return (torch.arange(held) * total + total // 2) // held


def split(data: Dataset, held: int) -> tuple[Dataset, Dataset]:
    """The scenes that train and `held` that do not, both in the order they had. Raises DataError, see above."""
    out = torch.zeros(len(data), dtype=torch.bool)
    out[held_places(len(data), held)] = True
    return data.take(~out), data.take(out)
