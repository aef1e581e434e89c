"""The scenes of a file as the page shows them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scenegen.api.reading import read_scenes
from scenegen.api.scene_arrays import SceneArrays, rows_of, stored_rows
from scenegen.api.spec import Spec, parse
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_SCENES
from scenegen.lang.counts import combinations, written
from scenegen.pose import as_poses, row_count
from scenegen.scene.data import SceneFile
from scenegen.view.jobs.evaluate import scene_set, told
from scenegen.view.jobs.source import with_numbers
from scenegen.view.limits import most_scenes

Part = tuple[dict[str, int], dict[str, Any]]


def stored_scenes(file: Path) -> tuple[list[Part], Spec, SceneFile]:
    """As many scenes of a file as the page takes, as the job `sample` sends them, with the spec and the head of the
    file. Where the spec draws numbers of things, there is a part for each combination of them, in lexicographic order;
    elsewhere there is one part, with no numbers. Raises DataError, SpecError, and RequestError where there are no
    scenes."""
    found = read_scenes(file)
    spec = parse(found.header.spec.source, file.name)
    if not len(found):
        raise RequestError(NO_SCENES(file=file.name))
    parts = list(found.parts())
    most = max(1, most_scenes(len(found.objects)) // len(parts))
    names = {tuple(numbers.values()): written(numbers) for numbers in combinations(spec.declared.counts)}
    scenes: list[Part] = []
    for numbers, which in parts:
        member, numbers = with_numbers(spec, tuple(sorted(numbers.items())))
        some = found.only(numbers, which[:most]) if numbers else found[:most]
        there = f" with {names[tuple(numbers.values())]}" if numbers else ""
        note = f"{len(some):,} of the {len(which):,} scenes{there} of {file.name}"
        scenes.append((numbers, _shown(member, some, note)))
    return scenes, spec, found.header


def _shown(spec: Spec, scenes: SceneArrays, note: str) -> dict[str, Any]:
    rows = rows_of(spec.checked, scenes)  # in the order of the spec, whatever the file's is
    count = row_count(len(spec.objects))
    on = stored_rows(spec.checked, rows)[count:].T if spec.checked.choices else None
    some = scene_set(spec, as_poses(rows[:count]), None, on)
    return {
        **told(spec, some, False),
        "poses": some.poses.tolist(),
        "sampler": scenes.header.sampler,
        "warnings": [],
        "notes": [note],
        "took": 0.0,
    }
