"""What notebooks show: of scenes a small contact sheet, and what was requested beside what came out; of a spec its
formulas as trees.

Drawing starts when a notebook asks for it; a set keeps its sheet, so that it is drawn once however often it is shown.
"""

from __future__ import annotations

import base64
import html
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.arrays import Array
from scenegen.errors import ScenegenError
from scenegen.scenes.data import SceneFile

if TYPE_CHECKING:
    from scenegen.api.scene_arrays import SceneArrays
    from scenegen.lang.spec import CheckedSpec


NOTEBOOK_SCENES = 8  # scenes of a sheet
SHEET_WIDTH = 320  # pixels of one of its pictures, where the workspace is square
PICTURE_WIDTH = 640  # of the picture of a single scene
MAX_NAMES = 20  # objects that a spec names
NOTEBOOK_LINES = 40  # of the formula of a label


def sheet(file: SceneFile, rest: Array | None = None) -> bytes | None:
    """The contact sheet of a scene file as PNG, None for one without scenes; `rest` as SceneArrays has it. Raises
    DataError."""
    return _render(file, SHEET_WIDTH, rest, sheet=True) if file.scenes else None


def picture(file: SceneFile, rest: Array | None = None) -> bytes | None:
    """A file's only scene in perspective, as PNG; None where it cannot be drawn: notebooks then show its `repr`. `rest`
    (N, 7) as Scene has it."""
    try:
        return _render(file, PICTURE_WIDTH, None if rest is None else rest[None], sheet=False)
    except ScenegenError:
        return None


def _render(file: SceneFile, width: int, rest: Array | None, *, sheet: bool) -> bytes:
    from scenegen.looks.stage import usual_size
    from scenegen.pictures.render.scenes import render_scenes

    size = usual_size(file, width)
    with tempfile.TemporaryDirectory() as folder:
        drawn = render_scenes(file, Path(folder), views=("perspective",), size=size, rest=rest)
        return (drawn.sheet if sheet else drawn.pictures[0]).read_bytes()


def page(scenes: SceneArrays, draw: Callable[[], bytes | None]) -> str:
    """A set of scenes as HTML, on its own: the picture is part of the text. Nothing in a scene file is trusted."""
    try:
        drawn = draw()
    except ScenegenError as error:
        drawn, said = None, f"<pre>{html.escape(str(error))}</pre>"
    else:
        said = ""
    parts = [f"<p>{_heading(scenes)}</p>", _table(scenes), said]
    if drawn is not None:
        data = base64.b64encode(drawn).decode()
        parts.append(f'<img alt="contact sheet" style="max-width: 100%" src="data:image/png;base64,{data}">')
    if len(scenes) > NOTEBOOK_SCENES:
        parts.append(f"<p>the first {NOTEBOOK_SCENES} of {len(scenes):,} scenes</p>")
    return "<div>" + "".join(parts) + "</div>"


def _heading(scenes: SceneArrays) -> str:
    title = scenes.header.spec.title
    count = f"{len(scenes):,} scene{'s' * (len(scenes) != 1)} of {html.escape(scenes.names())}"
    return f"<b>{html.escape(title)}</b><br>{count}" if title else f"<b>{count}</b>"


def _table(scenes: SceneArrays) -> str:
    if not len(scenes):
        return ""
    rows = ["<tr><th>label</th><th>target phi</th><th>lowest</th><th>mean</th><th>highest</th></tr>"]
    for label, values in scenes.phi.items():
        low, high = scenes.header.request.phi.get(label, (None, None))
        ends = ["" if end is None else f"{end:g}" for end in (low, high)]
        asked = ":".join(ends) if any(ends) else "any"
        cells = [html.escape(label), asked, *(f"{v:+.4f}" for v in (values.min(), values.mean(), values.max()))]
        rows.append("<tr>" + "".join(f"<td>{cell}</td>" for cell in cells) + "</tr>")
    return f"<table>{''.join(rows)}</table>"


def spec_page(spec: CheckedSpec) -> str:
    """A spec as HTML: its objects, and for each label the tree of its formula with the bounds of phi."""
    from scenegen.api.outline import Outline

    outline = Outline(spec)
    title = html.escape(spec.title)
    parts = [f"<p><b>{title}</b></p>" if title else "", f"<p>objects: {html.escape(_names(spec.objects))}</p>"]
    for label in outline.labels:
        lines, more = outline.lines(label, most=NOTEBOOK_LINES)
        rows = ["<tr><th>formula</th><th>margin</th><th>phi in</th></tr>"]
        for line in lines:
            indent = f"padding-left: {0.5 + 1.5 * line.depth:g}em; text-align: left"
            bounds = f"[{line.low:.4g}, {line.high:.4g}] {line.unit}".rstrip()
            cells = [f'<td style="{indent}">{html.escape(line.text)}</td>', _cell(line.margin), _cell(bounds)]
            rows.append(f"<tr>{''.join(cells)}</tr>")
        parts.append(f"<p><b>{html.escape(label)}</b></p><table>{''.join(rows)}</table>")
        if more:
            parts.append(f"<p>and {more:,} more</p>")
    return "<div>" + "".join(parts) + "</div>"


def _cell(text: str) -> str:
    return f'<td style="text-align: left">{html.escape(text)}</td>'


def _names(names: Sequence[str]) -> str:
    return ", ".join(names[:MAX_NAMES]) + (f" and {len(names) - MAX_NAMES:,} more" if len(names) > MAX_NAMES else "")
