"""phi over time from its definition, with plain loops over Python floats: the oracle. Formulas are tuples:

("atom", k) is signal k; ("not", f), ("and", f, g), ("or", f, g), ("always" | "eventually", a, b, f), ("until" |
"until_with", a, b, f, g), ("next", f), ("initially", f), ("finally", f). Windows are in moments.
"""

import math


def value(formula, signals, t):
    """The value at moment t; `signals` is a list of lists of T + 1 floats."""
    kind, *rest = formula
    last = len(signals[0]) - 1
    if kind == "atom":
        return signals[rest[0]][t]
    if kind == "not":
        return -value(rest[0], signals, t)
    if kind in ("and", "or"):
        return (min if kind == "and" else max)(value(part, signals, t) for part in rest)
    if kind in ("always", "eventually"):
        a, b, inner = rest
        found = [value(inner, signals, s) for s in range(t + a, t + b + 1) if s <= last]
        return min(found, default=math.inf) if kind == "always" else max(found, default=-math.inf)
    if kind == "next":
        return value(rest[0], signals, t + 1) if t < last else -math.inf
    if kind in ("initially", "finally"):
        return value(rest[0], signals, 0 if kind == "initially" else last)
    a, b, left, right = rest
    best = -math.inf
    for s in range(t + a, t + b + 1):
        if s <= last:
            holds = [value(left, signals, r) for r in range(t, s + (kind == "until_with"))]
            best = max(best, min([value(right, signals, s), *holds]))
    return best


def text(formula):
    """The formula as a spec writes it: signal k is the margin x(m) of object k."""
    kind, *rest = formula
    if kind == "atom":
        return f"x(o{rest[0]}) >= 0"
    if kind == "not":
        return f"!({text(rest[0])})"
    if kind in ("and", "or"):
        return f"({f' {kind} '.join(f'({text(part)})' for part in rest)})"
    if kind in ("always", "eventually"):
        return f"{kind}[{rest[0]}, {rest[1]}] ({text(rest[2])})"
    if kind in ("next", "initially", "finally"):
        return f"{kind} ({text(rest[0])})"
    a, b, left, right = rest
    return f"({text(left)}) {kind}[{a}, {b}] ({text(right)})"
