"""The paper's second data set: positives boosted by perturbing the scenes that satisfy the spec.

Where satisfying scenes are rare, a uniform data set hardly shows any. The paper moves the few there are by small noise
and keeps what still satisfies every label, until positives make up the share wanted (56 % in its experiment 3). In the
published sets up to 9.5 % of the scenes leave the unit square; here moved scenes outside the workspace are dropped, and
theta is wrapped. The positives stay close to the few they came from: fine for accuracy, poor for diversity.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor

from scenegen.errors import RequestError
from scenegen.errors.learning import TOO_RARE_TO_TRAIN
from scenegen.lang.formula.core import gate
from scenegen.lang.spec import CheckedSpec
from scenegen.learn.models.codec import Codec
from scenegen.learn.robustness import Robustness
from scenegen.learn.training.dataset import Dataset, base_draw, held_in_place, label_scenes
from scenegen.learn.training.gathering import Gathering
from scenegen.pose import THETA, row_count, rows_along

POSITIVES = 0.56
NOISE = 0.02  # standard deviation of the perturbation, in shares of the workspace and in turns
DRAWS = 5_000_000  # uniform scenes looked through for a positive before giving up
_LEAST_NOISE = 1e-6
_CHUNK = 65_536


def boosted(
    spec: CheckedSpec,
    scenes: int,
    generator: torch.Generator,
    gathering: Gathering | None = None,
    *,
    positives: float = POSITIVES,
    noise: float = NOISE,
    draws: int = DRAWS,
) -> Dataset:
    """`scenes` scenes, of which at least the share `positives` (0..1) satisfies every label, in random order.

    The others are a uniform sample. Where uniform scenes already hold the share, nothing is perturbed. Raises
    RequestError where `draws` uniform scenes hold no satisfying scene to start from.
    """
    gathering = gathering or Gathering()
    gathering.begin("gathering scenes", scenes)
    plain = label_scenes(spec, base_draw(spec, scenes, generator, gathering.reach))
    good = _satisfied(plain.phi)
    wanted = math.ceil(positives * scenes)
    hits = plain.rows[:, good]
    if hits.shape[1] >= wanted:
        return plain
    if not hits.shape[1]:
        gathering.begin("looking for a satisfied scene")
        hits = _search(spec, draws - scenes, generator, gathering)
    if not hits.shape[1]:
        raise RequestError(TOO_RARE_TO_TRAIN(draws=max(draws, scenes)))
    hits = hits[:, :wanted]
    gathering.begin("perturbing satisfied scenes", wanted - hits.shape[1])
    moved = _perturb(spec, hits, wanted - hits.shape[1], noise, generator, gathering)
    others = plain.rows[:, ~good]
    rows = torch.cat([hits, moved, others[:, : scenes - wanted]], dim=1)
    order = torch.randperm(scenes, generator=generator)
    return label_scenes(spec, rows[:, order].contiguous())


def _satisfied(phi: Tensor) -> Tensor:
    return (phi >= 0.0).all(dim=0)


def _search(spec: CheckedSpec, draws: int, generator: torch.Generator, gathering: Gathering) -> Tensor:
    """The satisfying scenes (3N, H) of the first chunk of uniform scenes that holds any; H = 0 where none does."""
    robustness = Robustness(spec.core)
    hits = torch.empty(row_count(len(spec.core.objects)), 0)
    for start in range(0, draws, _CHUNK):
        rows = base_draw(spec, min(_CHUNK, draws - start), generator)
        hits = rows[:, _satisfied(robustness.rows(rows))]
        if hits.shape[1]:
            break
        gathering.check()
    return hits


def _perturb(
    spec: CheckedSpec, hits: Tensor, count: int, noise: float, generator: torch.Generator, gathering: Gathering
) -> Tensor:
    """`count` perturbed hits (3N, count) that satisfy every label and what is required, and lie in the workspace."""
    robustness, codec = Robustness(gate(spec.core)), Codec(spec.workspace, len(spec.core.objects))
    source = codec.encode(hits)
    position = torch.ones(source.shape[1], dtype=torch.bool)
    position[rows_along(THETA)] = False
    kept: list[Tensor] = []
    found = 0
    while found < count:
        tries = min(_CHUNK, max(1024, 2 * (count - found)))
        pick = torch.randint(source.shape[0], (tries,), generator=generator)
        moved = source[pick] + noise * torch.randn(tries, source.shape[1], generator=generator)
        inside = ((moved >= 0.0) & (moved <= 1.0))[:, position].all(dim=1)
        moved[:, ~position] %= 1.0
        # Hits on a knife's edge bear no move at all: they are repeated as they are, so that this ends.
        rows = held_in_place(spec, codec.decode(moved[inside])) if noise > _LEAST_NOISE else hits[:, pick]
        rows = rows[:, _satisfied(robustness.rows(rows))]
        if rows.shape[1] < tries // 100:
            noise /= 2.0
        kept.append(rows)
        found += rows.shape[1]
        gathering.reach(min(found, count))
    return torch.cat([torch.empty_like(hits[:, :0]), *kept], dim=1)[:, :count]
