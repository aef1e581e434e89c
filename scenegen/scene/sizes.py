"""Scene files held against the limits that the language keeps to."""

from __future__ import annotations

from scenegen.errors import DataError
from scenegen.errors.files import SIZE_IN_FILE
from scenegen.scene.data import SceneFile, footprint_of
from scenegen.scene.limits import FARTHEST, SMALLEST, WIDEST


def check_sizes(header: SceneFile, largest: float = WIDEST) -> None:
    """Refuse what no spec can say: numbers beyond all measure, shapes without a volume, a workspace without an area;
    and objects that measure more than `largest` metres. Raises DataError."""
    (x0, x1), (y0, y1) = header.workspace.x, header.workspace.y
    least = min(x1 - x0, y1 - y0)
    if not least >= SMALLEST:
        size = least if least > 0.0 else None
        limits = f"give its x and y as [lowest, highest] in metres, {SMALLEST:g} m apart at least"
        raise DataError(SIZE_IN_FILE(what="the workspace", size=size, how="wide", limits=limits))
    places = [x0, x1, y0, y1]
    places += [value for region in header.regions for value in (region.pose.x, region.pose.y)]
    if max(map(abs, places)) > FARTHEST:
        facts = {"size": max(map(abs, places)), "how": "away", "limits": f"{FARTHEST:,.0f} m are the most"}
        raise DataError(SIZE_IN_FILE(what="the workspace or a region", **facts))
    for one in header.objects:
        lengths = *footprint_of(one.shape.footprint).extent, one.shape.height
        if not (min(lengths) >= SMALLEST and max(lengths) <= largest):
            size = min(lengths) if min(lengths) < SMALLEST else max(lengths)
            limits = f"sizes lie between {SMALLEST:g} and {largest:,.0f} m here"
            raise DataError(SIZE_IN_FILE(what=f"`{one.name}`", size=size, how="large", limits=limits))
    for region in header.regions:
        size = max(footprint_of(region.footprint).extent)
        if not size <= WIDEST:
            facts = {"size": size, "how": "large", "limits": f"{WIDEST:,.0f} m are the most"}
            raise DataError(SIZE_IN_FILE(what=f"the region `{region.name}`", **facts))
