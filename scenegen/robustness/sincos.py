"""Sine and cosine of headings, together, for compiled formulas.

The library's functions serve angles of any size and are called apart. Headings are small. With k quarter turns taken
off in three steps, what is left lies in [-pi/4, pi/4], where polynomials of r^2 do (through the Chebyshev nodes;
tests/robustness/test_sincos.py works them out). Errors stay below one unit in the last place of 1.0: 2e-16 and 1e-7.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import torch


@dataclass(frozen=True, slots=True)
class Constants:
    """Quarters of a turn in parts so short that k times one is exact; the factors of the polynomials p and q in
    sin(r) = r + r^3 p(r^2) and cos(r) = 1 - r^2 / 2 + r^4 q(r^2); and the largest angle for which all this holds."""

    quarter: tuple[float, float, float]
    sine: tuple[float, ...]
    cosine: tuple[float, ...]
    largest: float


DOUBLE = Constants(
    (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21),
    (
        -0.16666666666666666, 0.008333333333330948, -0.00019841269836756774,
        2.7557316101617874e-06, -2.505113165023518e-08, 1.5918115263265974e-10,
    ),
    (
        0.041666666666666664, -0.0013888888888887398, 2.480158729876456e-05,
        -2.7557317271145144e-07, 2.087614614655861e-09, -1.1382623647474604e-11,
    ),
    1e6,
)  # fmt: skip
SINGLE = Constants(
    (1.57080078125, -4.453584551811218e-06, -8.705515695504166e-10),
    (-0.16666664661714697, 0.008332748154085032, -0.00019587865702101875),
    (0.041666664658901405, -0.0013888302919113633, 2.4547916853691016e-05),
    6e3,
)


def turn(a: Any, constants: Constants) -> tuple[Any, Any]:
    """Cosine and sine of a tensor, or of what records what is done to it; NaN where an angle is too large."""
    a = torch.where(torch.abs(a) <= constants.largest, a, math.nan)
    quarters = torch.round(a * (2.0 / math.pi))
    rest = a
    for part in constants.quarter:
        rest = rest - quarters * part
    square = rest * rest
    sine = rest + rest * (square * _polynomial(constants.sine, square))
    cosine = 1.0 - square * (0.5 - square * _polynomial(constants.cosine, square))
    halves = torch.floor(quarters * 0.5)
    odd = halves != quarters * 0.5
    sign = 1.0 - 2.0 * (halves - 2.0 * torch.floor(halves * 0.5))
    return sign * torch.where(odd, -sine, cosine), sign * torch.where(odd, cosine, sine)


def _polynomial(factors: tuple[float, ...], x: Any) -> Any:
    value: Any = factors[-1]
    for factor in factors[-2::-1]:
        value = value * x + factor
    return value
