"""Start layouts for Isaac Lab-Arena: pools that its placer reads instead of solving, and episodes that it replays.

Arena changes quickly, and was not run. The forms are those of the files named below, read in August 2026.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from scenegen.api.scene_arrays import SceneArrays
from scenegen.arrays import Array
from scenegen.errors import DataError, RequestError
from scenegen.errors.files import SAME_NAME
from scenegen.errors.requests import NO_SCENES, ONLY_AT_BOUND, OUT_OF_RANGE, UNKNOWN_CHOICE, WRONG_VALUE
from scenegen.errors.worlds import TOO_FEW_LAYOUTS
from scenegen.play.frame import Axis, Origins, heading_of, placed
from scenegen.scenes.arrange import refuse_numbers
from scenegen.scenes.files import write_whole
from scenegen.validation import as_int, as_path


def write_arena_episodes(
    scenes: SceneArrays,
    path: str | Path,
    *,
    names: Mapping[str, str | None] | None = None,
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    turn: float = 0.0,
    origins: Origins = "base",
    up: Mapping[str, Axis] | None = None,
) -> Path:
    """Write scenes as recorded episodes, a line of JSON each, which Arena replays in this order; the file appears whole
    or not at all.

    `names` maps objects to the names of their roots in Arena's scene, and those that are anchors there, as a table, to
    None: they stay out of the file. Places are in the frame of an environment, with `origin`, `turn`, `origins` and
    `up` as `Layouts` has them; attitudes are whole, x, y, z, w. Beside its placement each line has `phi` by label,
    which Arena ignores. Raises RequestError, also for a name that does not end in .jsonl, and where the range of phi
    that was asked for is reached with probability 0 alone; DataError for no scenes and for those that differ in how
    many things there are, and OutputError.
    """
    # The form: isaaclab_arena/variations/recorded_variation_samples.py, relations/placement_sampler.py. Newer versions
    # keep a placement beside `variations`, and read this one as well; `source` is wanted by older ones only.
    path = as_path("path", path)
    if path.suffix.lower() != ".jsonl":
        raise RequestError(WRONG_VALUE(argument="path", value=repr(str(path)), wanted="a name that ends in .jsonl"))
    if not len(scenes):
        raise DataError(NO_SCENES())
    called, poses = _placed(scenes, "a file of episodes", names, (), origin, turn, origins, up, optional=True)
    lines = []
    for index, scene in enumerate(poses[..., [0, 1, 2, 4, 5, 6, 3]].tolist()):
        placement = {
            "layout_id": f"scenegen_{index:06d}",
            "source": "scenegen",
            "poses": {
                name: {"position_xyz": pose[:3], "rotation_xyzw": pose[3:]}
                for name, pose in zip(called, scene, strict=True)
                if name is not None
            },
        }
        phi = {label: float(values[index]) for label, values in scenes.phi.items()}
        record = {"variations": {"scene.relation_placement": placement}, "phi": phi}
        lines.append(json.dumps(record, allow_nan=False))
    write_whole(path, "".join(f"{line}\n" for line in lines).encode())
    return path


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
    that was asked for is reached with probability 0 alone, DataError for scenes that differ in how many things there
    are, and OutputError.
    """
    # The form: isaaclab_arena/relations/layout_pool_serialization.py
    path, num_envs = as_path("path", path), as_int("num_envs", num_envs)
    if num_envs < 1:
        raise RequestError(OUT_OF_RANGE(argument="num_envs", value=num_envs, wanted="1 or more"))
    if len(scenes) < num_envs:
        raise RequestError(TOO_FEW_LAYOUTS(scenes=len(scenes), environments=num_envs))
    still = {name: _anchor(name, pose) for name, pose in (anchors or {}).items()}
    called, poses = _placed(scenes, "a layout pool", names, tuple(still), origin, turn, origins)
    pools: list[list[dict[str, object]]] = [[] for _ in range(num_envs)]
    for index, scene in enumerate(poses.tolist()):
        positions = {name: pose[:3] for name, pose in zip(called, scene, strict=True)}
        yaws = {name: float(heading_of(pose[3:])) for name, pose in zip(called, scene, strict=True)}
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


def _placed(
    scenes: SceneArrays,
    what: str,
    names: Mapping[str, str | None] | None,
    others: Sequence[str],
    origin: Sequence[float],
    turn: float,
    origins: Origins,
    up: Mapping[str, Axis] | None = None,
    *,
    optional: bool = False,
) -> tuple[list[str | None], Array]:
    """The objects' names in Arena, none of them twice nor among the `others`, None for those without one, which may be
    where names are `optional`; and (n, N, 7) poses in its frame."""
    refuse_numbers(scenes.header, what)
    for warning in scenes.warnings:
        if warning.kind == ONLY_AT_BOUND:  # these scenes are beside the range, and not verified in it
            raise RequestError(replace(warning.but(ask=warning.facts["band"], band=None), severity="error"))
    names = names or {}
    for own, name in names.items():
        if own not in scenes.objects:
            raise RequestError(UNKNOWN_CHOICE(what="object", name=str(own), known=scenes.objects))
        if not (isinstance(name, str) and name) and (name is not None or not optional):
            wanted = "a name" + (", or None for what is an anchor" if optional else "")
            raise RequestError(WRONG_VALUE(argument=f"names[{own!r}]", value=repr(name), wanted=wanted))
    called = [names.get(own, own) for own in scenes.objects]
    if not any(called):
        raise RequestError(WRONG_VALUE(argument="names", value=repr(names), wanted="a name for one object or more"))
    everything = [*filter(None, called), *others]
    for name in everything:
        if everything.count(name) > 1:
            raise RequestError(SAME_NAME(name=name, objects="objects"))
    return called, placed(scenes, origin, turn, origins, up)


def _anchor(name: str, pose: Sequence[float]) -> list[float]:
    wanted = "(x, y, z) or (x, y, z, yaw)"
    try:
        numbers = [float(one) for one in pose]
    except (TypeError, ValueError):
        numbers = []
    if len(numbers) not in (3, 4) or not all(map(math.isfinite, numbers)):
        raise RequestError(WRONG_VALUE(argument=f"anchors[{name!r}]", value=repr(pose), wanted=wanted))
    return numbers if len(numbers) == 4 else [*numbers, 0.0]
