"""`scenegen assets`: the objects of the library, as a table and as pictures."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.options import argument, option
from scenegen.cli.output import print_error
from scenegen.errors import RequestError

if TYPE_CHECKING:
    from scenegen.things.library import Asset


def assets(
    names: list[str] | None = argument("Names of objects; all of the library if left out.", "NAME", default=None),
    out: Path | None = option("A folder for pictures of them.", "DIR"),
    size: str = option("Width and height of a picture in pixels.", "WxH", default="320x240"),
    json_: bool = option("The table as JSON.", flags="--json"),
    workers: int | None = option("Processes that draw; default: one per core."),
) -> None:
    """List the objects of the library: their sizes, masses and friction.

    \b
      scenegen assets
      scenegen assets mug cracker_box
      scenegen assets --out pictures

    The name of an object in a spec picks its asset: `object mug, fork[3], plate_2`. Lengths are metres, length is along
    the heading; masses are kilograms. With --out, every asset is drawn, and all on contact_sheet.png.
    """
    found = _find_assets(names or [])
    if json_:
        print(json.dumps([_row(asset) for asset in found], indent=2))
    else:
        print(_table(found))
    if out is not None:
        made = _draw(found, out, size, workers)
        print_error(f"drew {len(made)} pictures in {out}; contact sheet: {made[-1]}")


def _find_assets(names: list[str]) -> list[Asset]:
    """The assets of these names. Raises RequestError for one that is not in the library."""
    from scenegen.errors.declarations import UNKNOWN_ASSET
    from scenegen.things import ASSETS, asset_of, has_picture

    for name in names:
        if not has_picture(name):
            raise RequestError(UNKNOWN_ASSET(name=name, known=sorted(ASSETS)))
    return list(dict.fromkeys(map(asset_of, names))) if names else sorted(ASSETS.values(), key=lambda one: one.name)


def _row(asset: Asset) -> dict[str, Any]:
    from scenegen.scenes.data import footprint_data
    from scenegen.things.library import shape_of
    from scenegen.things.surfaces import rooms_of, sizes_of, surfaces_of

    shape = shape_of(asset.name)

    return {
        "name": asset.name,
        "footprint": footprint_data(asset.footprint).model_dump(),
        "height": asset.height,
        "mass": asset.mass,
        "friction": asset.friction,
        "color": list(asset.color),
        "hollow": bool(rooms_of(shape)),
        "surfaces": {one.name: sizes_of(shape, one) for one in surfaces_of(shape)},
    }


def _table(found: list[Asset]) -> str:
    from scenegen.geometry import Circle

    rows = [("name", "footprint", "height", "mass", "friction", "")]
    for asset in found:
        length, width = asset.footprint.extent
        size = f"radius {length / 2:g}" if isinstance(asset.footprint, Circle) else f"{length:g} x {width:g}"
        facts = _row(asset)
        hollow = _inner(*next(iter(facts["surfaces"].items()))) if facts["hollow"] else ""
        rows.append((asset.name, size, f"{asset.height:g}", f"{asset.mass:g}", f"{asset.friction:g}", hollow))
    widths = [max(len(row[column]) for row in rows) for column in range(6)]
    lines = []
    for row in rows:
        cells = [row[k].ljust(widths[k]) if k in (0, 1, 5) else row[k].rjust(widths[k]) for k in range(6)]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)


def _inner(name: str, sizes: dict[str, float]) -> str:
    """How large a hollow object is inside."""
    return f"hollow: {name} {sizes['length']:.4g} x {sizes['width']:.4g}, {sizes['depth']:.4g} deep"


def _draw(found: list[Asset], out: Path, size: str, workers: int | None) -> list[Path]:
    from scenegen.cli.render import parse_size
    from scenegen.pictures.render.files import check_request
    from scenegen.pictures.render.gallery import gallery, library_sheet
    from scenegen.scenes.files import check_folder, whole_files

    shape = parse_size(size)
    check_request(("perspective",), shape, workers)
    check_folder(out)
    pictures = gallery([asset.name for asset in found], shape, workers)
    files = {f"{name}.png": data for name, data in pictures.items()} | {"contact_sheet.png": library_sheet(pictures)}
    with whole_files(out) as put:
        for name, data in files.items():
            put(name, data)
    return [out / name for name in files]
