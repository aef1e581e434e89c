"""Scene files held against the limits that the language keeps to."""

from __future__ import annotations

from scenegen.errors import DataError, Diagnostic
from scenegen.scene.data import SceneFile, footprint_of
from scenegen.scene.limits import FARTHEST, SMALLEST, WIDEST


def check_sizes(header: SceneFile, largest: float = WIDEST) -> None:
    """Refuse what no spec can say: numbers beyond all measure, shapes without a volume, a workspace without an area;
    and objects that measure more than `largest` metres. Raises DataError."""
    (x0, x1), (y0, y1) = header.workspace.x, header.workspace.y
    least = min(x1 - x0, y1 - y0)
    if not least >= SMALLEST:
        title = f"the workspace is {least:.3g} m wide" if least > 0.0 else "the workspace is empty"
        help_ = f"give its x and y as [lowest, highest] in metres, {SMALLEST:g} m apart at least"
        raise DataError(Diagnostic(title, help=help_))
    places = [x0, x1, y0, y1]
    places += [value for region in header.regions for value in (region.pose.x, region.pose.y)]
    if max(map(abs, places)) > FARTHEST:
        title = f"the workspace or a region is {max(map(abs, places)):.3g} m away"
        raise DataError(Diagnostic(title, help=f"{FARTHEST:,.0f} m are the most"))
    for one in header.objects:
        lengths = *footprint_of(one.shape.footprint).extent, one.shape.height
        if not (min(lengths) >= SMALLEST and max(lengths) <= largest):
            title = f"`{one.name}` has a size of {min(lengths) if min(lengths) < SMALLEST else max(lengths):.3g} m"
            help_ = f"sizes lie between {SMALLEST:g} and {largest:,.0f} m here"
            raise DataError(Diagnostic(title, help=help_))
    for region in header.regions:
        size = max(footprint_of(region.footprint).extent)
        if not size <= WIDEST:
            title = f"the region `{region.name}` is {size:.3g} m large"
            raise DataError(Diagnostic(title, help=f"{WIDEST:,.0f} m are the most"))
