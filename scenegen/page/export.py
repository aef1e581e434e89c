"""A page without a server: one file with a spec, some of its scenes and what they are worth."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from scenegen.api.motions import MotionSet, sample_motions
from scenegen.api.rarity import SpecRarity, rarity
from scenegen.api.request import Phi
from scenegen.api.sample import sample
from scenegen.api.scenes import SceneSet
from scenegen.api.spec import Spec, parse
from scenegen.errors import RequestError
from scenegen.errors.program import PAGE_LIMIT
from scenegen.lang.checker import check_file
from scenegen.page.jobs import motions
from scenegen.page.jobs.check import rarity_data
from scenegen.page.jobs.describe import describe, mesh_key, numbers_data, packed_mesh
from scenegen.page.jobs.evaluate import reasons, scene_set, scenes_json
from scenegen.page.jobs.motions import six_digits
from scenegen.page.jobs.source import stage_of_spec, wanted_counts, with_numbers
from scenegen.page.project import OpenProject, alone
from scenegen.page.worker import finite
from scenegen.sampling.request import SampleRequest
from scenegen.scenes.data import SceneFile
from scenegen.scenes.files import check_writable, write_whole
from scenegen.scenes.formats.registry import check_ending
from scenegen.scenes.motions import MotionFile

EXPORTED_SATISFIED_SHARE = 0.4  # of the scenes: satisfy every label; the others are spread over what phi can be
MAX_PAGE_BYTES = 25_000_000


def export_page(opened: OpenProject, out: Path, n: int, seed: int, command: str = "") -> int:
    """Write the page of what was opened into the file `out`; returns its size in bytes.

    Of a spec, `n` scenes are sampled: some that satisfy all labels, the others evenly over the phi that can be reached.
    Of a scene file, its own scenes are shown. Where the spec draws numbers of things, all have the same: in a file the
    most that its scenes have. `command` is what made the page. Raises RequestError, OutputError.
    """
    check_ending(out, ".html", ".htm")
    check_writable(out)
    root = opened.folder.root
    path = root / (opened.path or f"{opened.name}.spec")
    family = parse(opened.text, opened.name) if opened.scenes else Spec(check_file(path, opened.text.encode(), root))
    spec, numbers = with_numbers(family, wanted_counts(opened.request))
    rare = rarity(spec)
    some = _motions if spec.over_time is not None else _scenes
    scenes, reports, header = some(opened, spec, rare, n, seed)
    described = {**describe(spec), "numbers": numbers_data(family, numbers)}
    data = opened.data() | {
        "folder": "",
        "path": None,
        "sha": None,
        "model": None,
        "scenes": scenes,
        "parts": [],
        "request": {},
        "alone": {
            "spec": described,
            "meshes": {mesh_key(one): packed_mesh(one.shape, tuple(one.color)) for one in stage_of_spec(spec).things},
            "rarity": [rarity_data(one) for one in rare.labels],
            "reports": reports,
            "file": header.model_dump(mode="json", exclude={"scenes", "motions"}),
            "command": command,
        },
    }
    page = alone(finite(data)).encode()
    if len(page) > MAX_PAGE_BYTES:
        raise RequestError(PAGE_LIMIT(size=len(page) / 1e6))
    write_whole(out, page)
    return len(page)


SetT = TypeVar("SetT", SceneSet, MotionSet)


def _draw_parts(spec: Spec, rare: SpecRarity, n: int, draw: Callable[[Phi, int], SetT], inset: float) -> list[SetT]:
    """Some that satisfy all labels, where there are any, and others spread flat over the phi of the first label, but
    for the share `inset` at each of its ends."""
    parts: list[SetT] = []
    with contextlib.suppress(RequestError):  # nothing satisfies it: all are spread
        parts.append(draw(dict.fromkeys(spec.labels, (0.0, None)), max(1, round(EXPORTED_SATISFIED_SHARE * n))))
    rest = n - sum(map(len, parts))
    if rest > 0:
        first = rare.labels[0]
        low, high = first.reached
        ends = (low + inset * (high - low), high - inset * (high - low))
        parts.append(draw({first.label: ends} if low < high else {}, rest))
    return parts


def _scenes(
    opened: OpenProject, spec: Spec, rare: SpecRarity, n: int, seed: int
) -> tuple[dict[str, Any], list[dict[str, Any]], SceneFile]:
    """The scenes of the page, why each has its phi, and the head of a file of them."""
    if opened.scenes is not None:
        scenes = scene_set(spec, opened.scenes["poses"], opened.scenes["sampler"], opened.scenes["on"])
    else:

        def draw(phi: Phi, count: int) -> SceneSet:
            return sample(spec, phi, count, seed=seed, workers=1, keep_partial=True)

        parts = _draw_parts(spec, rare, n, draw, inset=0.02)
        on = np.concatenate([one.on for one in parts if one.on is not None]) if spec.checked.choices else None
        scenes = scene_set(spec, np.concatenate([one.poses for one in parts]), {"method": "exact", "seed": seed}, on)
    reports = [_round_values(reasons(spec, scenes[index : index + 1])) for index in range(len(scenes))]
    own = {name: opened.scenes[name] for name in ("together", "warnings")} if opened.scenes else {}
    return {**scenes_json(spec, scenes), **own}, reports, scenes.header


def _motions(
    opened: OpenProject, spec: Spec, rare: SpecRarity, n: int, seed: int
) -> tuple[dict[str, Any], list[dict[str, Any]], MotionFile]:
    """The same of a spec over time. Raises RequestError for more than the page shows."""
    if opened.scenes is not None:
        poses = motions.motions_of(spec, opened.scenes["motions"])
        sampler = opened.scenes["sampler"]
    else:
        motions.check_size(spec, 1)

        def draw(phi: Phi, count: int) -> MotionSet:
            return sample_motions(spec, phi, count, seed=seed, workers=1, keep_partial=True)

        parts = _draw_parts(spec, rare, min(n, motions.most_of(spec)), draw, inset=0.0)
        poses, sampler = np.concatenate([one.poses for one in parts]), {"method": "exact", "seed": seed}
    header = motions.motion_set(spec, poses, sampler, SampleRequest(n=len(poses))).header
    reports = [_shorten_signals(motions.reasons(spec, one, everything=False)) for one in poses]
    return motions.motions_json(spec, poses, sampler), reports, header


def _shorten_signals(found: dict[str, Any]) -> dict[str, Any]:
    """Every number over time to six digits."""
    decides = {name: one and {**one, "signal": six_digits(one["signal"])} for name, one in found["decides"].items()}
    signals = {name: six_digits(row) for name, row in found["signals"].items()}
    return {**_round_values(found), "signals": signals, "decides": decides}


def _round_values(found: dict[str, Any]) -> dict[str, Any]:
    """Values to six digits: they colour a tree, and there are many."""
    return {**found, "values": six_digits(found["values"])}
