"""A page without a server: one file with a spec, some of its scenes and what they are worth."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from scenegen.api.rarity import SpecRarity, rarity
from scenegen.api.sample import sample
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec, parse
from scenegen.errors import RequestError
from scenegen.errors.files import WRONG_ENDING
from scenegen.errors.page import PAGE_TOO_LARGE
from scenegen.formats.files import check_writable, write_whole
from scenegen.lang.check import check_file
from scenegen.view.document import alone
from scenegen.view.jobs.describe import describe, mesh_key, stage_of_spec
from scenegen.view.jobs.evaluate import reasons, scene_set, told
from scenegen.view.jobs.meshes import packed_mesh
from scenegen.view.jobs.range import rarity_data
from scenegen.view.opened import Opened
from scenegen.view.wire import finite

SATISFIED = 0.4  # of the scenes: satisfy every label; the others are spread over what phi can be
MOST_BYTES = 25_000_000


def export_page(opened: Opened, out: Path, n: int, seed: int, command: str = "") -> int:
    """Write the page of what was opened into the file `out`; returns its size in bytes.

    Of a spec, `n` scenes are sampled: some that satisfy all labels, the others evenly over the phi that can be reached.
    Of a scene file, its own scenes are shown. `command` is what made the page. Raises RequestError, OutputError.
    """
    if out.suffix.lower() not in (".html", ".htm"):
        raise RequestError(WRONG_ENDING(path=out, ending=".html", better="page.html"))
    check_writable(out)
    root = opened.folder.root
    path = root / (opened.path or f"{opened.name}.spec")
    spec = parse(opened.text, opened.name) if opened.scenes else Spec(check_file(path, opened.text.encode(), root))
    rare = rarity(spec)
    if opened.scenes is not None:
        scenes = scene_set(spec, opened.scenes["poses"], opened.scenes["sampler"], opened.scenes["on"])
    else:
        scenes = _sampled(spec, rare, n, seed)
    data = opened.data() | {
        "folder": "",
        "path": None,
        "sha": None,
        "model": None,
        "scenes": _scenes(spec, scenes),
        "request": {},
        "alone": {
            "spec": describe(spec),
            "meshes": {mesh_key(one): packed_mesh(one.shape, tuple(one.color)) for one in stage_of_spec(spec).things},
            "rarity": [rarity_data(one) for one in rare.labels],
            "reports": [_rounded(reasons(spec, scenes[index : index + 1])) for index in range(len(scenes))],
            "command": command,
        },
    }
    page = alone(finite(data)).encode()
    if len(page) > MOST_BYTES:
        raise RequestError(PAGE_TOO_LARGE(size=len(page) / 1e6))
    write_whole(out, page)
    return len(page)


def _sampled(spec: Spec, rare: SpecRarity, n: int, seed: int) -> SceneSet:
    """Scenes that satisfy all labels, where there are any, and scenes spread flat over the phi of the first label."""
    solved = max(1, round(SATISFIED * n))
    parts: list[SceneSet] = []
    try:
        wanted = dict.fromkeys(spec.labels, (0.0, None))
        parts.append(sample(spec, wanted, solved, seed=seed, workers=1, keep_partial=True))
    except RequestError:  # nobody satisfies it: all scenes are spread
        solved = 0
    rest = n - sum(map(len, parts))
    if rest > 0:
        first = rare.labels[0]
        low, high = first.reached
        ends = (low + 0.02 * (high - low), high - 0.02 * (high - low))
        phi = {first.label: ends} if low < high else {}
        parts.append(sample(spec, phi, rest, seed=seed, workers=1, keep_partial=True))
    poses = np.concatenate([one.poses for one in parts])
    on = np.concatenate([one.on for one in parts if one.on is not None]) if spec.checked.choices else None
    return scene_set(spec, poses, {"method": "exact", "seed": seed}, on)


def _scenes(spec: Spec, scenes: SceneSet) -> dict[str, Any]:
    return {
        **told(spec, scenes, False),
        "poses": scenes.poses.round(5).tolist(),
        "sampler": scenes.header.sampler,
        "warnings": [],
        "notes": [],
        "took": 0.0,
    }


def _rounded(found: dict[str, Any]) -> dict[str, Any]:
    """Values to six digits: they colour a tree, and there are many."""
    return {**found, "values": [float(f"{one:.6g}") for one in found["values"]]}
