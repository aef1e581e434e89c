"""Texts that attack by size: a line that expands to hundreds of thousands of parts, long lines, deep nests, thousands
of labels and definitions. What they mean is not looked at, only what it costs to find out."""

from __future__ import annotations

import random

from .generate import Case

BODIES = [
    "x(a) <= x(b) + i * 1 cm",
    "x(a) * i <= 3 m",
    "closeTo(a, b, i * 1 mm) & f(a, i)",
    "f(a, i) -> f(b, i + 1)",
    "angle(a, i * 1 deg)",
    "x(a) / i <= 1 mm",
    "x(o[i]) <= x(o[i + 1])",
    "closeTo(o.first, o[i])",
    "exists p in o: closeTo(p, a, i * 1 cm)",
    "noOverlap([a, b] + o)",
    "abs(sin(i * 1 deg) * x(a) - max(y(b), x(b), i * 1 cm)) <= 1 cm | !f(b, i)",
    # mistakes
    "x(a) <= x(b) + i",
    "x(a) + i * 1 cm",
    "theta(a) <= i",
    "i",
    "x(a) <= theta(b) * i & y(a)",
    "f(a)",
]
PAIRS = [
    "gap(p, q) >= 0",
    "x(p) <= x(q) + 1 cm & f(p, 2)",
    "!closeTo(p, q) | facing(p, q)",
    "mirrored(p, q) -> overlaps(p, q)",
    "p",
    "gap(p, p) >= 0",
    "x(p) <= theta(q)",
]
COUNTS = [300, 3_000, 20_000, 99_999, 199_999, 200_000, 300_000, 10**9]
DEEP = ["(", "!", "-", "abs(", "[", "forall p in o: ", "x(a) <= 1 & (", "f(a, ", "x(a) <= 1 -> ("]


def sized(rng: random.Random) -> Case:
    """A text of one of these kinds."""
    head = f"object a, b, o[{rng.choice([2, 30, 400, 2_000, 20_000])}]\ndef f(p, k) = x(p) <= k * 1 cm\n"
    word = rng.choice(["forall", "exists"])
    kind = rng.randrange(9)
    if kind <= 1:
        text = f"{word} i in 1..{rng.choice(COUNTS)}: {rng.choice(BODIES)}"
    elif kind == 2:
        first, second = rng.choice([(2, 99_999), (99_999, 2), (447, 447), (20, 9_999), (9_999, 20)])
        low = rng.choice(["1", "1", "i"])
        text = f"{word} i in 1..{first}: exists j in {low}..i + {second}: {rng.choice(BODIES)} & x(b) <= j * 1 cm"
    elif kind == 3:
        text = f"{word} p, q in {rng.choice(['o', 'objects', 'consecutive(o)', '[a, b] + o'])}: {rng.choice(PAIRS)}"
    elif kind == 4:
        text = f"{word} p in o: exists q in objects: {rng.choice(PAIRS)}"
    elif kind == 5:
        signs = rng.choice([" & ", " | ", " -> ", " + "])
        text = signs.join(f"x(a) <= {number}" for number in range(rng.choice([2_000, 20_000])))
    elif kind == 6:
        opening, times = rng.choice(DEEP), rng.choice([500, 9_000, 30_000])
        text = opening * times + "x(a) <= 1" + ")" * (times if rng.random() < 0.5 else 0)
    elif kind == 7:
        count = rng.choice([500, 2_000])
        names = "".join(f"def g{number}(p) = f(p, {number}) & leftOf(p, b)\n" for number in range(count))
        return Case((head + names + "".join(f"l{n}: g{n}(a)\n" for n in range(count))).encode(), sized=True)
    else:  # each calls the one before twice, with other arguments
        count = rng.choice([12, 17, 40])
        head += "def g0(p, k) = f(p, k)\n"
        head += "".join(f"def g{n}(p, k) = g{n - 1}(p, 2 * k) & g{n - 1}(p, 2 * k + 1)\n" for n in range(1, count))
        text = f"g{count - 1}(a, 1)"
    return Case(f"{head}{rng.choice(['task: ', 'require '])}{text}\nlast: leftOf(a, b)\n".encode(), sized=True)
