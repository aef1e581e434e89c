"""Tail probabilities for the tests of distribution: Kolmogorov, Kuiper, chi-square.

Scalars, plain Python, no dependence on scipy; relative error below 1e-9 if the tail exceeds 1e-300.
"""

from __future__ import annotations

import math

_EPS = 1e-16


def kolmogorov_tail(x: float) -> float:
    """P(K > x) of the limit law of sqrt(n) sup |F_n - F| (Kolmogorov 1933).

    2 sum (-1)^(j-1) exp(-2 j^2 x^2), and below x = 1 one minus its Jacobi transform,
    sqrt(2 pi) / x sum exp(-(2j - 1)^2 pi^2 / 8 x^2); either needs at most six terms.
    """
    if x <= 0.0:
        return 1.0
    if x < 1.0:
        body = sum(math.exp(-(((2 * j - 1) * math.pi / x) ** 2) / 8.0) for j in range(1, 7))
        return 1.0 - math.sqrt(2.0 * math.pi) / x * body
    return 2.0 * math.fsum((-1) ** (j - 1) * math.exp(-2.0 * (j * x) ** 2) for j in range(1, 7))


def kuiper_tail(x: float) -> float:
    """P(V > x) of the limit law of sqrt(n) (sup (F_n - F) + sup (F - F_n)) (Kuiper 1960).

    2 sum (4 j^2 x^2 - 1) exp(-2 j^2 x^2); below x = 0.4, where it differs from 1 by less than 1e-6 and the terms grow
    in number, 1.
    """
    if x < 0.4:
        return 1.0
    squares = [(j * x) ** 2 for j in range(1, 12)]
    return min(1.0, max(0.0, 2.0 * math.fsum((4.0 * square - 1.0) * math.exp(-2.0 * square) for square in squares)))


def chi_square_tail(x: float, degrees: int) -> float:
    """P(X > x) of the chi-square law: the regularised upper incomplete gamma function Q(degrees / 2, x / 2).

    The power series of 1 - Q (Abramowitz & Stegun 6.5.29) left of a + 1, Legendre's continued fraction (6.5.31,
    even part) by the modified Lentz method right of it; O(sqrt(degrees)) terms.
    """
    a, z = degrees / 2.0, x / 2.0
    if z <= 0.0:
        return 1.0
    front = math.exp(a * math.log(z) - z - math.lgamma(a))
    if z < a + 1.0:
        term = total = 1.0 / a
        n = a
        while term > total * _EPS:
            n += 1.0
            term *= z / n
            total += term
        return max(0.0, 1.0 - front * total)
    if front == 0.0:
        return 0.0
    b = z + 1.0 - a
    c, d = math.inf, 1.0 / b
    fraction, step, j = d, 0.0, 0
    while abs(step - 1.0) > 10.0 * _EPS:
        j += 1
        an = -j * (j - a)
        b += 2.0
        d = 1.0 / (an * d + b)
        c = b + an / c
        step = c * d
        fraction *= step
    return front * fraction
