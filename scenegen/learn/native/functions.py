"""The functions that formulas use, in C: what comes before a formula's own function.

The library's sine, cosine and arc tangent serve numbers of any size and one at a time. These serve a loop that the
compiler turns into vector instructions, without branches and calls. Errors stay below one unit in the last place of 1.0
for sine and cosine, and below two of pi for the angle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from string import Template


@dataclass(frozen=True, slots=True)
class Constants:
    """The type in C, an unsigned type of as many bits, and the ending of its functions' names.

    `quarter` of a turn in parts so short that k times one is exact; the factors of the polynomials p, q and s in
    sin(r) = r + r^3 p(r^2), cos(r) = 1 - r^2 / 2 + r^4 q(r^2) for |r| <= pi / 4, and atan(r) = r + r^3 s(r^2) for
    |r| <= tan(pi / 8). They go through the Chebyshev nodes; tests/native/test_functions.py works them out. `largest` is
    the largest angle for which all this holds, `rounding` a number so large that the sum with it has no digits behind
    the point.
    """

    type: str
    bits: str
    suffix: str
    quarter: tuple[float, float, float]
    sine: tuple[float, ...]
    cosine: tuple[float, ...]
    tangent: tuple[float, ...]
    largest: float
    rounding: float


DOUBLE = Constants(
    "double",
    "unsigned long",
    "",
    (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21),
    (
        -0.16666666666666666, 0.008333333333330948, -0.00019841269836756774,
        2.7557316101617874e-06, -2.505113165023518e-08, 1.5918115263265974e-10,
    ),
    (
        0.041666666666666664, -0.0013888888888887398, 2.480158729876456e-05,
        -2.7557317271145144e-07, 2.087614614655861e-09, -1.1382623647474604e-11,
    ),
    (
        -0.3333333333333325, 0.19999999999898324, -0.1428571426608229, 0.11111109635603796, -0.09090852527088297,
        0.07691054614825647, -0.06649607953399717, 0.057362969593526145, -0.04483218628995374, 0.022748939747779046,
    ),
    1e6,
    1.5 * 2.0**52,
)  # fmt: skip
SINGLE = Constants(
    "float",
    "unsigned int",
    "f",
    (1.57080078125, -4.453584551811218e-06, -8.705515695504166e-10),
    (-0.16666664661714697, 0.008332748154085032, -0.00019587865702101875),
    (0.041666664658901405, -0.0013888302919113633, 2.4547916853691016e-05),
    (-0.33333331760434554, 0.1999954031495797, -0.14263949753605723, 0.10743668324830098, -0.06451718869358958),
    6e3,
    1.5 * 2.0**23,
)  # fmt: skip


def preamble(constants: Constants) -> str:
    """Types, macros and functions."""
    first, second, third = map(_literal, constants.quarter)
    return _PREAMBLE.substitute(
        type=constants.type,
        bits=constants.bits,
        f=constants.suffix,
        sign=8 * (8 if constants.suffix == "" else 4) - 1,
        quarters=_literal(2.0 / math.pi),
        first=first,
        second=second,
        third=third,
        sine=_polynomial(constants.sine),
        cosine=_polynomial(constants.cosine),
        tangent=_polynomial(constants.tangent),
        largest=_literal(constants.largest),
        rounding=_literal(constants.rounding),
        turn=_literal(2.0 * math.pi),
        turns=_literal(0.5 / math.pi),
        half=_literal(math.pi),
        quarter=_literal(0.5 * math.pi),
        eighth=_literal(0.25 * math.pi),
        bound=_literal(math.tan(math.pi / 8.0)),
    )


def _literal(value: float) -> str:
    return f"((number){value.hex()})"


def _polynomial(factors: tuple[float, ...]) -> str:
    """In z, by Horner's rule."""
    *rest, text = map(_literal, factors)
    for factor in reversed(rest):
        text = f"({text} * z + {factor})"
    return text


_PREAMBLE = Template("""\
#include <math.h>
#include <string.h>
typedef $type number;
typedef $bits bits;
#define FABS __builtin_fabs$f
#define SQRT __builtin_sqrt$f
#define CEIL __builtin_ceil$f
#define FLOOR __builtin_floor$f
#define COPYSIGN __builtin_copysign$f
#define LARGEST $largest
#define ROUNDING $rounding

static inline number LEAST(number a, number b) { return a < b ? a : b; }
static inline number MOST(number a, number b) { return a > b ? a : b; }

struct turn { number cosine, sine; };

static inline number flipped(number a, bits sign)
{
  bits whole;
  memcpy(&whole, &a, sizeof a);
  whole ^= sign;
  memcpy(&a, &whole, sizeof a);
  return a;
}

/* Quarters of a turn are taken off; the last bits of `shifted` say how many. */
static inline struct turn turn(number a)
{
  number shifted = a * $quarters + ROUNDING, quarters = shifted - ROUNDING;
  bits k;
  memcpy(&k, &shifted, sizeof k);
  number r = a - quarters * $first;
  r = r - quarters * $second;
  r = r - quarters * $third;
  number z = r * r;
  number sine = r + r * (z * $sine);
  number cosine = 1 - z * ((number)0.5 - z * $cosine);
  int odd = (k & 1) != 0;
  struct turn result;
  result.cosine = flipped(odd ? sine : cosine, ((k + 1) & 2) << ($sign - 1));
  result.sine = flipped(odd ? cosine : sine, (k & 2) << ($sign - 1));
  return result;
}

/* The angle of (x, y), by that of a slope of at most tan(pi / 8). */
static inline number angle(number y, number x)
{
  number ax = FABS(x), ay = FABS(y), less = LEAST(ax, ay), more = MOST(ax, ay);
  int steep = less > $bound * more;
  number above = steep ? less - more : less, below = steep ? less + more : more;
  number r = above / (below == 0 ? 1 : below), z = r * r;
  number found = r + r * (z * $tangent);
  found = steep ? $eighth + found : found;
  found = ay > ax ? $quarter - found : found;
  found = COPYSIGN((number)1, x) < 0 ? $half - found : found;
  return COPYSIGN(found, y);
}

/* A heading brought to [0, 2 pi). */
static inline number heading(number a)
{
  number rest = __builtin_fma$f(-FLOOR(a * $turns), $turn, a);
  rest = rest < 0 ? rest + $turn : rest;
  rest = rest >= $turn ? rest - $turn : rest;
  return a < 0 || a >= $turn ? rest : a;
}
""")
