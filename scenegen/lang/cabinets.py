"""`cabinet(drawers = 3, open = 0.6)`: how many drawers a cabinet has, and whether each is open enough."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from scenegen.assets import Shape
from scenegen.assets.boards import Surface
from scenegen.assets.cabinet import DRAWERS, MOST, Cabinet
from scenegen.assets.library import cabinet_shape
from scenegen.assets.surfaces import narrowest
from scenegen.errors import Diagnostic, Source, Span, SpecError
from scenegen.errors.declarations import DRAWER_COUNT, DRAWER_NOT_OPEN, DRAWER_SHARE, DRAWER_SHARES
from scenegen.errors.language import NOT_A_PLAIN_NUMBER, NOT_CONSTANT
from scenegen.lang.measure import Arguments
from scenegen.lang.provenance import Frame
from scenegen.lang.select import whole_number
from scenegen.lang.values import ListValue
from scenegen.primitives.units import BARE

if TYPE_CHECKING:
    from scenegen.lang.lower import Lowering

ROOM = 1e-3  # per cent: what just fits would be held by rounding alone


def cabinet(lowering: Lowering, given: Arguments, source: Source) -> Shape:
    """A cabinet's shape. `open` is a list of shares, the lowest drawer first, or the share of the topmost drawer alone.
    Raises SpecError."""
    drawers = None
    if "drawers" in given:
        value, expr = given["drawers"]
        what = "the number of drawers"
        drawers = whole_number(lowering, lowering.coerce.number(value, what), expr, Frame(source), what)
        if not 1 <= drawers <= MOST:
            raise SpecError(DRAWER_COUNT(expr.span(source), given=drawers, most=MOST))
    if "open" not in given:
        return cabinet_shape((0.0,) * (drawers or DRAWERS))
    value, expr = given["open"]
    here, what = expr.span(source), "the share by which a drawer is open"
    shares = []
    for item in value.items if isinstance(value, ListValue) else (value,):
        number = lowering.coerce.number(item, what)
        share = lowering.builder.value(number.node)
        if share is None:
            raise SpecError(NOT_CONSTANT(here, what=what))
        if number.unit != BARE:
            raise SpecError(NOT_A_PLAIN_NUMBER(here, what=what, found=number.unit.words))
        if not 0.0 <= share <= 1.0:
            raise SpecError(DRAWER_SHARE(here, given=share))
        shares.append(share)
    if not isinstance(value, ListValue):
        return cabinet_shape((*(0.0,) * ((drawers or DRAWERS) - 1), *shares))
    if len(shares) != (drawers or len(shares)) or not 1 <= len(shares) <= MOST:
        raise SpecError(DRAWER_SHARES(here, given=len(shares), drawers=drawers or None, most=MOST))
    return cabinet_shape(tuple(shares))


def not_open(lowering: Lowering, upper: int, carrier: int, surface: Surface, here: Span) -> Diagnostic | None:
    """What to say where an object would fit into a drawer that were open further, or that drawers above it did not
    hide; None of other surfaces, and where the object is too large for any drawer."""
    pull = surface.pull
    need = None if pull is None else narrowest(lowering.shapes[upper].footprint, pull.width)
    if pull is None or need is None:
        return None
    shares = list(lowering.shapes[carrier].open or Cabinet().open)
    number = int(surface.name.partition("[")[2].rstrip("]")) - 1
    least, above = _rounded(pull.least(need)), ""
    if least > 1.0:
        shares = [*shares[: number + 1], *(0.0 for _ in shares[number + 1 :])]
        alone = Cabinet(tuple(shares)).surfaces()[number + 1].pull
        assert alone is not None
        least, above = _rounded(alone.least(need)), "close the drawers above it and "
    if not shares[number] < least <= 1.0 and not (above and least <= 1.0):
        return None
    shares[number] = max(least, shares[number])
    return DRAWER_NOT_OPEN(
        here,
        name=lowering.builder.objects[upper],
        drawer=surface.name,
        carrier=lowering.builder.objects[carrier],
        share=100.0 * pull.share,
        reach=100.0 * max(pull.reach, 0.0),
        need=100.0 * need,
        least=least,
        above=above,
        mended=f"cabinet(open = [{', '.join(f'{share:g}' for share in shares)}])",
    )


def _rounded(share: float) -> float:
    """Up to the next hundredth, with some room."""
    return math.ceil(100.0 * share + ROOM) / 100.0
