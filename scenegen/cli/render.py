"""`scenegen render`: pictures of scenes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from scenegen.api.scenes import SceneSet


def render(
    scenes: Annotated[Path, typer.Argument(help="A scenes file.", metavar="SCENES", show_default=False)],
    out: Annotated[Path, typer.Option("--out", help="The folder for the pictures.", metavar="DIR", show_default=False)],
    size: Annotated[
        str, typer.Option("--size", help="Width and height of a picture in pixels.", metavar="WxH")
    ] = "640x480",
    workers: Annotated[
        int | None, typer.Option("--workers", help="Processes that draw; default: one per core.")
    ] = None,
) -> None:
    """Draw every scene from above and in perspective, and a contact sheet of all with phi under each picture.

    \b
      scenegen render scenes.json --out pictures
      scenegen render scenes.json --out pictures --size 1280x960

    Needs no display and no GPU. Pictures are numbered in scene order: scene_0001_top.png, scene_0001_perspective.png.
    """
    from scenegen.api.scenes import check_count, read_scenes

    width, height = parse_size(size)
    found = read_scenes(scenes)
    check_count(found)
    draw(found, out, (width, height), workers)


def parse_size(text: str) -> tuple[int, int]:
    """`640x480` -> (640, 480). Raises RequestError."""
    from scenegen.errors import Diagnostic, RequestError, Source, Span

    match = re.fullmatch(r"(\d{1,6})x(\d{1,6})", text, re.ASCII)
    if match is None:
        here = Span(Source("--size", text), 0, len(text))
        raise RequestError(Diagnostic("a size is written WIDTHxHEIGHT", here, "", "for instance: --size 640x480"))
    return int(match[1]), int(match[2])


def draw(scenes: SceneSet, out: Path, size: tuple[int, int] = (640, 480), workers: int | None = None) -> None:
    """Draw with a progress bar, and say where the pictures are."""
    from scenegen.assets import ASSETS, PLAIN, UNKNOWN, has_picture
    from scenegen.cli.output import print_error, progress_bar
    from scenegen.errors import quoted

    with progress_bar() as bar:
        task = bar.add_task("drawing", total=len(scenes))
        drawn = scenes.render(
            out, size=size, workers=workers, progress=lambda done, total: bar.update(task, completed=done)
        )
    shown = {*ASSETS, *PLAIN} - {UNKNOWN}
    unknown = [one.name for one in scenes.header.objects if one.shape.asset not in shown and not has_picture(one.name)]
    if unknown:
        print_error(f"note: no picture for {quoted(unknown)}: drawn as blocks; there are {', '.join(sorted(ASSETS))}")
    print_error(f"drew {len(drawn.pictures)} pictures in {out}; contact sheet: {drawn.sheet}")
