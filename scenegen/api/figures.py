"""Figures of a set of scenes: contact sheet, sweep from hard to solved, heat map, top views with what decides phi."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scenegen import given
from scenegen.api.labels import chosen_label
from scenegen.api.scene_arrays import SceneArrays, rows_of
from scenegen.errors import Diagnostic, RequestError, quoted, suggest
from scenegen.formats.folder import scene_name, whole_files
from scenegen.lang.check import check_text
from scenegen.lang.core import Atom
from scenegen.lang.interpret import deciding_atom, evaluate
from scenegen.scene.data import SceneFile

if TYPE_CHECKING:
    from PIL import Image

Progress = Callable[[int, int], None]

FIGURES = ("sheet", "sweep", "gif", "heatmap", "topview")
SHOWN = 6  # scenes of a strip
FRAMES = 36  # scenes of an animation


@dataclass(frozen=True, slots=True)
class Look:
    """How the pictures are drawn that figures are put together from."""

    view: str
    size: tuple[int, int]
    distinct: bool
    workers: int | None
    progress: Progress | None

    def pictures(self, file: SceneFile) -> Iterator[Image.Image]:
        """Those of a file's scenes, one after the other."""
        from scenegen.render.thumbs import pictures

        return pictures(
            file, self.view, self.size, distinct=self.distinct, workers=self.workers, progress=self.progress
        )


def figures(
    scenes: SceneArrays,
    out: str | Path,
    kinds: tuple[str, ...],
    *,
    view: str = "perspective",
    size: tuple[int, int] | None = None,
    distinct: bool = False,
    label: str | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> tuple[Path, ...]:
    """Make figures in the folder `out` (made if its parent is there); the paths of their files.

    `kinds` are of "sheet" (contact_sheet.png), "sweep" (sweep.png: one layout from hard to solved, as a strip), "gif"
    (the same as sweep.gif), "heatmap" (heatmap.png: where each object goes) and "topview" (scene_0001_topview.svg, ...:
    names, headings, and the atom that decides phi of `label`, the first one if left out, as a dimension line). `view`
    and `size` are those of the pictures that sheet, sweep and gif are put together from; `distinct` colours objects
    apart that would look the same.

    Raises RequestError for what cannot be drawn, DataError where the scenes' spec is of no use, OutputError.
    """
    from scenegen.render.request import check_request, usual_size

    folder = given.path("out", out)
    known = f"the figures are {quoted(FIGURES)}"
    kinds = given.words("kinds", kinds, '("sheet", "gif")')
    if not kinds:
        help_ = f'name the folder first, then what to draw: figures("pictures", "sheet"); {known}'
        raise RequestError(Diagnostic("no figure was asked for", help=help_))
    for kind in kinds:
        if kind not in FIGURES:
            help_ = suggest(kind, FIGURES, known)
            raise RequestError(Diagnostic(f"unknown figure `{kind}`", help=help_))
    size = usual_size(scenes.header) if size is None else size
    check_request((view,), size, workers)
    look = Look(view, size, distinct, workers, progress)
    if not len(scenes):
        raise RequestError(Diagnostic("there are no scenes in this file", help="sample some first"))
    made: dict[str, bytes] = {}
    if "sheet" in kinds:
        made["contact_sheet.png"] = _sheet(scenes, look)
    if "sweep" in kinds or "gif" in kinds:
        made |= _sweep(scenes, kinds, label, look)
    if "heatmap" in kinds:
        from scenegen.render.heatmap import heatmap

        made["heatmap.png"] = heatmap(scenes.file(), distinct=distinct)
    if "topview" in kinds:
        made |= _topviews(scenes, label)
    with whole_files(folder) as put:
        for name, data in made.items():
            put(name, data)
    return tuple(folder / name for name in made)


def _sheet(scenes: SceneArrays, look: Look) -> bytes:
    from PIL import Image

    from scenegen.render.sheet import SHOWN as MOST
    from scenegen.render.sheet import contact_sheet, thumbnail_size

    file = scenes.file()
    first = file.model_copy(update={"scenes": file.scenes[:MOST]})
    small = thumbnail_size(look.size, len(scenes))
    drawn = look.pictures(first)
    return contact_sheet(file, [picture.resize(small, Image.Resampling.LANCZOS) for picture in drawn])


def _sweep(scenes: SceneArrays, kinds: tuple[str, ...], label: str | None, look: Look) -> dict[str, bytes]:
    from PIL import Image

    from scenegen.api.sweep import sweep
    from scenegen.render.stage import overlaps_of
    from scenegen.render.strip import animation, strip

    frames, chosen = sweep(scenes, label, FRAMES)
    phi = [float(value) for value in frames.phi[chosen]]
    picked = sorted({round(place) for place in np.linspace(0, len(frames) - 1, SHOWN)})
    file = frames.file()
    if "gif" not in kinds:
        file = file.model_copy(update={"scenes": [file.scenes[place] for place in picked]})
        phi, picked = [phi[place] for place in picked], list(range(len(picked)))
    drawn = list(look.pictures(file))
    notes = [", ".join(pairs) for pairs in overlaps_of(file)]
    made = {}
    if "sweep" in kinds:
        small = round(look.size[0] * 0.5), round(look.size[1] * 0.5)
        shown = [drawn[place].resize(small, Image.Resampling.LANCZOS) for place in picked]
        values, said = [phi[place] for place in picked], [notes[place] for place in picked]
        made["sweep.png"] = strip(shown, values, chosen, scenes.header.spec.title.rstrip("."), said)
    if "gif" in kinds:
        made["sweep.gif"] = animation(drawn, phi, chosen, notes)
    return made


def _topviews(scenes: SceneArrays, label: str | None) -> dict[str, bytes]:
    from scenegen.render.dimensions import dimensions, short
    from scenegen.render.topview import Thing, View, topview

    spec = check_text(scenes.header.spec.source, "the spec of these scenes")
    chosen = chosen_label(spec.labels, label)
    zones = [Thing(one.name, one.footprint, one.pose, zone=True) for one in spec.regions]
    made = {}
    for number, rows in enumerate(rows_of(spec, scenes).T, start=1):
        values = evaluate(spec.core, rows.tolist())
        node = deciding_atom(spec.core, chosen, values)
        atom = spec.core.nodes[node]
        assert isinstance(atom, Atom)
        phi = values[spec.core.labels[chosen]]
        things = [
            Thing(name, shape.footprint, (float(x), float(y), float(theta)))
            for name, shape, (x, y, theta) in zip(spec.objects, spec.shapes, rows.reshape(-1, 3), strict=True)
        ]
        view = View(
            [*zones, *things],
            x=spec.workspace.x,
            y=spec.workspace.y,
            marks=dimensions(spec.core, node, rows.tolist()),
            caption=[f"{atom.text} decides", f"{chosen} = {short(phi)}"],
            good=phi >= 0.0,
        )
        made[f"{scene_name(number, len(scenes))}_topview.svg"] = topview(view, width=480).encode()
    return made
