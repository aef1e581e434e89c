"""Coverage: how much of the true distribution a set of generated scenes reaches.

The share of reference scenes whose nearest generated scene lies within that reference scene's own k-th-nearest-
neighbour radius in the reference (Naeem et al. 2020, with the neighbourhoods of the reference). A fresh set from the
truth scores 1 - 2^-k on average for sets of equal size, i.e. 0.969 for k = 5.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from scenegen.errors import DataError, Diagnostic

Array = npt.NDArray[np.float64]

NEIGHBOURS = 5
_BLOCK = 2_000_000  # squared distances held at a time: 16 MB


def features(rows: npt.ArrayLike) -> Array:
    """Poses (3N, B) in metres and radians -> (B, 4N): x, y, cos(theta) / 2 pi, sin(theta) / 2 pi per object.

    The angle enters as a circle with a circumference of 1, so that a full turn weighs as much as the unit square's
    edge. Raises DataError for another shape or coordinates that are not finite.
    """
    poses = np.asarray(rows, dtype=np.float64)
    if poses.ndim != 2 or poses.shape[0] % 3 or not poses.shape[0]:
        raise DataError(Diagnostic(f"poses of shape {poses.shape}; expected (3N, B)"))
    if not np.isfinite(poses).all():
        raise DataError(Diagnostic("a pose is not finite", help="check the scenes for NaN and infinity"))
    x, y, theta = poses[0::3], poses[1::3], poses[2::3]
    turn = 2.0 * np.pi
    return np.concatenate([x, y, np.cos(theta) / turn, np.sin(theta) / turn]).T


def coverage(reference: npt.ArrayLike, generated: npt.ArrayLike, *, neighbours: int = NEIGHBOURS) -> float:
    """Share in [0, 1] of the `reference` scenes (3N, R) that the `generated` scenes (3N, G) cover.

    Memory stays at a few tens of MB for any R and G; time grows with R * (R + G). Raises DataError where the two sets
    hold different numbers of objects, nothing was generated, or R <= neighbours.
    """
    truth, made = features(reference), features(generated)
    if truth.shape[1] != made.shape[1]:
        title = f"the reference has {truth.shape[1] // 4} objects per scene, the generated scenes {made.shape[1] // 4}"
        raise DataError(Diagnostic(title, help="compare scenes of the same spec"))
    if len(truth) <= neighbours or not len(made):
        raise DataError(
            Diagnostic(
                f"coverage needs more than {neighbours} reference scenes and at least one generated scene",
                help=f"got {len(truth)} and {len(made)}",
            )
        )
    # Distances do not depend on the origin, but their rounding does.
    origin = truth.mean(axis=0)
    truth, made = truth - origin, made - origin
    covered = 0
    step = max(1, _BLOCK // max(len(truth), len(made)))
    for start in range(0, len(truth), step):
        part = truth[start : start + step]
        among = _squared_distances(part, truth)
        among[np.arange(len(part)), start + np.arange(len(part))] = np.inf
        radius = np.partition(among, neighbours - 1, axis=1)[:, neighbours - 1]
        covered += int((_squared_distances(part, made).min(axis=1) <= radius).sum())
    return covered / len(truth)


def _squared_distances(a: Array, b: Array) -> Array:
    square: Array = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1)[None, :]
    square -= 2.0 * (a @ b.T)
    return np.maximum(square, 0.0, out=square)
