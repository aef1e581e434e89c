"""Layout pools of Isaac Lab-Arena: the JSON that its `PooledObjectPlacer.load` reads instead of solving.

The form is that of isaaclab_arena/relations/layout_pool_serialization.py (August 2026): by environment a list of
layouts, each with positions and yaws by object name, checks, a loss and a number of attempts.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from scenegen.api.scene_arrays import SceneArrays
from scenegen.errors import RequestError
from scenegen.errors.placing import NAME_TWICE, TOO_FEW_LAYOUTS
from scenegen.errors.requests import ONLY_AT_BOUND, OUT_OF_RANGE, UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.formats.files import write_whole
from scenegen.layouts.placing import Origins, placed
from scenegen.training.datasets.arrange import refuse_numbers
from scenegen.validation import as_int, as_path


def write_arena_pool(
    scenes: SceneArrays,
    path: str | Path,
    *,
    num_envs: int = 1,
    names: Mapping[str, str] | None = None,
    anchors: Mapping[str, Sequence[float]] | None = None,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    turn: float = 0.0,
    origins: Origins = "base",
    uses_env_specific_bboxes: bool = False,
    seed: int | None = None,
) -> Path:
    """Write scenes as a layout pool, dealt to the environments in turn; the file appears whole or not at all.

    `names` maps objects to names in Arena. `anchors` are the objects that Arena has and the spec does not, such as the
    table: (x, y, z) or (x, y, z, yaw) by name; the reader wants all objects. Places are in the frame of an
    environment, with `origin`, `turn` and `origins` as `Layouts` has them; the yaw is in radians. `seed` is that of
    Arena's own choices. Raises RequestError, also where there are fewer scenes than environments or the range of phi
    that was asked for is reached with probability 0 alone, DataError for
    scenes that differ in how many things there are, and OutputError.
    """
    path, num_envs = as_path("path", path), as_int("num_envs", num_envs)
    if num_envs < 1:
        raise RequestError(OUT_OF_RANGE(argument="num_envs", value=num_envs, wanted="1 or more"))
    refuse_numbers(scenes.header, "a layout pool")
    for warning in scenes.warnings:
        if (
            warning.kind == ONLY_AT_BOUND
        ):  # these scenes are beside the range that was asked for, and not verified in it
            raise RequestError(replace(warning.but(ask=warning.facts["band"], band=None), severity="error"))
    if len(scenes) < num_envs:
        raise RequestError(TOO_FEW_LAYOUTS(scenes=len(scenes), environments=num_envs))
    called = _names(scenes, names or {})
    still = {name: _anchor(name, pose) for name, pose in (anchors or {}).items()}
    everything = [*called, *still]
    for name in everything:
        if everything.count(name) > 1:
            raise RequestError(NAME_TWICE(name=name))
    poses = placed(scenes, origin, turn, origins)
    pools: list[list[dict[str, object]]] = [[] for _ in range(num_envs)]
    for index, scene in enumerate(poses.tolist()):
        positions = {name: pose[:3] for name, pose in zip(called, scene, strict=True)}
        yaws = {name: 2.0 * math.atan2(pose[6], pose[3]) for name, pose in zip(called, scene, strict=True)}
        layout = {
            "positions": positions | {name: pose[:3] for name, pose in still.items()},
            "orientations": yaws | {name: pose[3] for name, pose in still.items()},
            "validation": {"scenegen_verified": True},
            "final_loss": 0.0,
            "attempts": 1,
        }
        pools[index % num_envs].append(layout)
    document = {
        "placement_seed": None if seed is None else as_int("seed", seed),
        "num_envs": num_envs,
        "uses_env_specific_bboxes": bool(uses_env_specific_bboxes),
        "had_fallbacks": False,
        "env_pools": pools,
    }
    write_whole(path, json.dumps(document, allow_nan=False).encode())
    return path


def _names(scenes: SceneArrays, names: Mapping[str, str]) -> list[str]:
    for own in names:
        if own not in scenes.objects:
            raise RequestError(UNKNOWN_CHOICE(what="object", name=str(own), known=scenes.objects))
    return [names.get(own, own) for own in scenes.objects]


def _anchor(name: str, pose: Sequence[float]) -> list[float]:
    wanted = "(x, y, z) or (x, y, z, yaw)"
    try:
        numbers = [float(one) for one in pose]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) not in (3, 4) or not all(map(math.isfinite, numbers)):
        raise RequestError(WRONG_VALUE(argument=f"anchors[{name!r}]", value=repr(pose), wanted=wanted))
    return numbers if len(numbers) == 4 else [*numbers, 0.0]
