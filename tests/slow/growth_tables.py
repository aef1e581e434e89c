"""Tables on which growth is held against other samplers and against known laws, and a test of hard rods."""

import math

import numpy as np
from scipy import stats

from scenegen.lang.checker import check_text
from scenegen.sampling.plans import draw
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget

from ..sampling.plain import shipped, square_line

N = 2000
SEEDS = range(5)
LEAST_P = 0.01


def drawn(text, ranges, method, n=N, seed=0, spread="base"):
    problem = make_problem(
        check_text(text),
        SampleRequest({name: Range(*ends) for name, ends in ranges.items()}, n=n, seed=seed, spread=spread),
    )
    found = draw(problem, Budget(600.0), method=method)
    assert found.shortfall is None and found.count == n
    return found


def at_least(value=0.0):
    return {"task": (value, None)}


BINS = """object item[4] = cylinder(0.03, 0.05)
workspace [0, 0.6] x [0, 0.5]
region left = rect(0.0, 0.0, 0.2, 0.2)
region right = rect(0.4, 0.0, 0.6, 0.2)
require noOverlap(item)
task: forall i in item: inside(i, left) | inside(i, right)
"""
DINNER = """object plate = cylinder(0.12, 0.02), fork = box(0.18, 0.02, 0.01), knife = box(0.2, 0.02, 0.01)
object glass = cylinder(0.04, 0.1)
workspace [0, 0.8] x [0, 0.6]
require noOverlap()
task: leftOf(fork, plate) & rightOf(knife, plate) & closeTo(fork, plate, 0.2) & closeTo(knife, plate, 0.2)
      & angle(fork, NORTH, 0.3) & angle(knife, NORTH, 0.3) & closeTo(glass, knife, 0.2) & aboveOf(glass, knife)
"""
DISCS = """object disc[8] = cylinder(0.04, 0.02)
workspace [0, 0.4] x [0, 0.4]
require noOverlap() & insideWorkspace()
task: leftOf(disc[1], disc[2])
"""
BOXES = """object box[3] = box(0.2, 0.1, 0.02)
workspace [0, 0.36] x [0, 0.3]
require noOverlap() & insideWorkspace()
task: leftOf(box[1], box[2])
"""
# pruned rejection accepts 1 in 300,000 candidates of BOXES, of this 1 in 3,000: so full a reference can be
ROOMY = BOXES.replace("[0, 0.36] x [0, 0.3]", "[0, 0.42] x [0, 0.36]")
ISLANDS = """object mug, plate, cup, bowl
task: leftOf(mug, plate) & closeTo(mug, plate, 0.2) & leftOf(cup, bowl) & closeTo(cup, bowl, 0.2)
"""
CHAIN = "leftOf(a, b) & leftOf(b, c) & closeTo(a, c, 0.4) | belowOf(a, b) & belowOf(b, c) & closeTo(a, c, 0.4)"
TABLES = {
    "4 items in 2 bins": (BINS, at_least(), ("rejection", "splitting")),
    "dinner for one, noOverlap": (DINNER, at_least(), ("rejection", "splitting")),
    "8 discs, 25 % full": (DISCS, at_least(), ("splitting",)),
    "3 boxes, 40 % full": (ROOMY, at_least(), ("rejection", "splitting")),
    "two pairs apart": (ISLANDS, at_least(0.05), ("rejection", "splitting")),
    "one of two chains": (CHAIN, at_least(0.05), ("rejection", "splitting")),
}

# name -> spec, range, log10 of the probability of range and requirement where a formula gives it
KNOWN = {
    "two discs in a box": (
        "object a = cylinder(0.1, 0.1), b = cylinder(0.1, 0.1)\nrequire noOverlap() & insideWorkspace()\n"
        "task: closeTo(a, b, 0.5)", {"task": (0.1, 0.4)}, math.log10(0.8**4 * (square_line(0.5) - square_line(0.25)))),
    "exp 3, N = 3": (shipped("sort_3"), {"sorted": (0.05, None)}, None),
    **{f"{n} sorted points, gaps of {gap}": (
        " & ".join(f"leftOf(p{k}, p{k + 1})" for k in range(n - 1)), at_least(gap),
        n * math.log10(1 - (n - 1) * gap) - math.log10(math.factorial(n)))
       for n, gap in ((3, 0.2), (5, 0.0), (6, 0.1), (10, 0.02), (20, 0.0), (30, 0.01))},
    **{f"{n} rods of 4 cm on a line": (
        f"object rod[{n}] = cylinder(0.02, 0.1)\nworkspace [0, 1] x [0, 0.000001]\nrequire noOverlap()\n"
        "task: closeTo(rod[1], (0.5, 0), 1)", at_least(), n * math.log10(1 - (n - 1) * 0.04))
       for n in (4, 10, 15)},
}  # fmt: skip


def rods(n):
    text, ranges, _ = KNOWN[f"{n} rods of 4 cm on a line"]
    return text, ranges


def rod_p(places, length=0.04):
    """p of places (N, B) of rods' middles: with (k - 1) lengths taken off the k-th, they are N sorted uniform points of
    what is left, so the k-th has a beta distribution, and so has the least gap."""
    n = len(places)
    free = 1 - (n - 1) * length
    middle = (np.sort(places, axis=0) - length * np.arange(n)[:, None]) / free
    p = [stats.kstest(middle[k], stats.beta(k + 1, n - k).cdf).pvalue for k in range(n)]
    least = np.diff(middle, axis=0).min(axis=0)
    p.append(stats.kstest(1 - (1 - np.minimum((n - 1) * least, 1.0)) ** n, "uniform").pvalue)
    return min(1.0, min(p) * len(p))
