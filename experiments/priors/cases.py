"""The twenty specs of this folder as Python data: how their base distributions are drawn, and which phi is asked for.

None of it is read from the specs, so that a mistake on either side shows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from experiments.priors.draws import Draws, Floats, Place, Posed, disc, polygon, rectangle, turned_box

SPECS = Path(__file__).parent / "specs"
DEG = math.pi / 180.0
NORTH, EAST = 90.0 * DEG, 0.0


@dataclass(frozen=True)
class Drawn:
    """Poses of all objects in the spec's order; of those that stand on one of several surfaces which, from 0, by
    name."""

    poses: list[Posed]
    surfaces: dict[str, Floats] | None = None


@dataclass(frozen=True)
class Case:
    """A spec, `count` of whose blocks there are where the spec draws that; how its base distribution is drawn; the
    range of phi of `task`. `probability_of_surfaces` is that of things that choose a surface to lie on the one that
    they chose, as `log10_probability` counts it: where uniform places over the workspace would lie."""

    spec: str
    draw: Callable[[Draws], Drawn]
    phi: tuple[float, float]
    count: int | None = None
    probability_of_surfaces: float = 1.0

    @property
    def path(self) -> Path:
        return SPECS / f"{self.spec}.spec"

    @property
    def uniform_text(self) -> str:
        """The same spec without its priors."""
        lines = self.path.read_text(encoding="utf-8").splitlines(True)
        return "".join(line for line in lines if not line.startswith("usually "))


def narrow(d: Draws) -> Drawn:
    return Drawn([(d.normal(0.4, 0.3, 0.005), d.circle()), (d.anywhere(), d.circle())])


def wide(d: Draws) -> Drawn:
    return Drawn([(d.normal(1.1, 0.5, 0.3), d.circle()), (d.normal(0.3, 0.6, 0.4), d.circle())])


def headings(d: Draws) -> Drawn:
    knife = d.turn_normal(NORTH, 10.0 * DEG)
    fork = d.turn_uniform(-20.0 * DEG, 25.0 * DEG)
    mug = d.turn_normal(EAST, 80.0 * DEG)
    return Drawn([(d.anywhere(), heading) for heading in (knife, fork, mug)])


def mixture(d: Draws) -> Drawn:
    butter = d.place_mixture([(7, d.uniform(rectangle(0.0, 0.0, 0.4, 1.0))), (3, d.normal(0.6, 0.2, 0.05))])
    plate = d.place_mixture([(1, d.anywhere()), (1, d.normal(0.6, 0.25, 0.04))])
    return Drawn([(butter, d.circle()), (plate, d.circle())])


def array_mixture(d: Draws) -> Drawn:
    def block() -> Posed:
        place = d.place_mixture([(1, d.normal(0.3, 0.3, 0.08)), (2, d.normal(0.7, 0.6, 0.12))])
        north, west = d.turn_normal(NORTH, 10.0 * DEG), d.turn_uniform(170.0 * DEG, 190.0 * DEG)
        return place, d.turn_mixture([(1, north), (3, west)])

    return Drawn([block() for _ in range(4)])


def relative(d: Draws) -> Drawn:
    saucer = d.anywhere()
    return Drawn([(saucer, d.circle()), (d.normal(*saucer, 0.03), d.circle())])


def setting(d: Draws) -> Drawn:
    x, y = d.normal(0.5, 0.35, 0.1)
    fork = d.normal(x - 0.17, y, 0.02), d.turn_normal(NORTH, 10.0 * DEG)
    knife = d.normal(x + 0.17, y, 0.02), d.turn_normal(NORTH, 10.0 * DEG)
    return Drawn([((x, y), d.circle()), fork, knife])


def relative_mixture(d: Draws) -> Drawn:
    plate, tray = d.anywhere(), d.anywhere()
    mug = d.place_mixture([(7, d.normal(*plate, 0.12)), (3, d.normal(*tray, 0.05))])
    spoon = d.normal(*mug, 0.1)
    return Drawn([(place, d.circle()) for place in (spoon, mug, plate, tray)])


def relative_heading(d: Draws) -> Drawn:
    (x, y), turned = d.anywhere(), d.circle()
    fork = d.turn_normal(turned, 15.0 * DEG)
    knife = d.turn_normal(fork + math.pi, 40.0 * DEG)
    return Drawn([((x, y), turned), (d.normal(x - 0.17, y, 0.02), fork), (d.anywhere(), knife)])


def kernels(d: Draws) -> Drawn:
    rows = np.array(
        [
            [(0.2, 0.3, 0.0), (0.25, 0.35, 90.0 * DEG)],
            [(0.7, 0.7, 180.0 * DEG), (0.62, 0.7, 10.0 * DEG)],
            [(0.71, 0.69, 200.0 * DEG), (0.3, 0.3, 0.0)],
            [(0.995, 0.5, 350.0 * DEG), (0.9, 0.5, 0.0)],
        ]
    )
    return Drawn([*d.recorded(rows, 0.01, 5.0 * DEG), (d.anywhere(), d.circle())])


def logs(d: Draws) -> Drawn:
    rows = np.loadtxt(SPECS / "logs.csv", delimiter=",", skiprows=1).reshape(-1, 2, 3)
    return Drawn([*d.recorded(rows, 0.06, 30.0 * DEG), (d.anywhere(), d.circle())])


def regions(d: Draws) -> Drawn:
    mug = d.uniform(rectangle(-0.2, 0.1, 0.3, 0.5))
    plate = d.uniform(disc(0.9, 0.8, 0.25))
    can = d.uniform(polygon([(0.3, 0.6), (0.6, 0.55), (0.5, 0.95)]))
    book = d.uniform(polygon([(0.35, 0.15), (0.65, 0.3), (0.6, 0.4), (0.3, 0.25)]))
    return Drawn([(place, d.circle()) for place in (mug, plate, can, book)])


def turned(d: Draws) -> Drawn:
    tray = np.full(d.n, 0.55), np.full(d.n, 0.45)
    inside = turned_box(0.55, 0.45, 30.0 * DEG, 0.378, 0.278)
    can = d.uniform(inside)
    pen = d.place_mixture([(3, d.uniform(inside)), (1, d.anywhere())])
    moved: list[Place] = [can, pen, d.normal(*can, 0.15)]
    return Drawn([(tray, np.full(d.n, 30.0 * DEG)), *((place, d.circle()) for place in moved)])


def choices(d: Draws) -> Drawn:
    fridge, table = rectangle(0.0, 0.6, 0.5, 1.0), rectangle(0.0, 0.0, 1.0, 0.5)
    places, which = [], []
    for weights in ((7, 3), (1, 4)):
        picked = d.pick(weights)
        on_fridge, on_table = d.uniform(fridge), d.uniform(table)
        places.append((np.choose(picked, [on_fridge[0], on_table[0]]), np.choose(picked, [on_fridge[1], on_table[1]])))
        which.append(picked.astype(np.float64))
    mug = d.normal(0.3, 0.2, 0.06)
    poses = [(place, d.circle()) for place in (*places, mug)]
    return Drawn(poses, {"butter": which[0], "jam": which[1]})


def shelf(d: Draws) -> Drawn:
    d = replace(d, x=(0.1, 0.9), y=(0.7, 0.95))  # what stands on a surface is cut off at the rectangle round it
    jar = d.normal(0.5, 0.8, 0.1)
    cans = [d.normal(*jar, 0.1) for _ in range(2)]
    return Drawn([(place, d.circle()) for place in (jar, *cans, d.normal(jar[0], 0.82, 0.1))])


def counts(blocks: int) -> Callable[[Draws], Drawn]:
    def draw(d: Draws) -> Drawn:
        plate = d.anywhere()
        around = [d.normal(*plate, 0.15) for _ in range(blocks)]
        return Drawn([(place, d.circle()) for place in (*around, plate)])

    return draw


def outside(d: Draws) -> Drawn:
    return Drawn([(d.normal(0.2, 0.5, 0.08), d.circle()), (d.normal(0.5, 0.5, 0.1), d.circle())])


def crowd(d: Draws) -> Drawn:
    return Drawn([(d.normal(0.3, 0.4, 0.005), d.circle()), *((d.anywhere(), d.circle()) for _ in range(9))])


def boxes(d: Draws) -> Drawn:
    books = [(d.normal(0.5, 0.5, 0.25), d.turn_normal(NORTH, 20.0 * DEG)) for _ in range(5)]
    return Drawn([*books, (d.anywhere(), d.circle())])


def rare(d: Draws) -> Drawn:
    plate = d.anywhere()
    mug = d.normal(*plate, 0.2)
    bowl = d.normal(*mug, 0.2)
    return Drawn([(place, d.circle()) for place in (mug, plate, bowl)])


def _of_surfaces(*weights: tuple[float, float]) -> float:
    """The product over things with these weights of the fridge, 0.2 m^2, and the table, 0.5 m^2, of a workspace of
    1 m^2: the share of the switch that an option has is as its weight over its area."""
    return math.prod((a + b) / (a / 0.2 + b / 0.5) for a, b in weights)


CASES = {
    "narrow": Case("narrow", narrow, (0.0, 0.1)),
    "wide": Case("wide", wide, (0.0, 0.1)),
    "headings": Case("headings", headings, (0.0, 0.1)),
    "mixture": Case("mixture", mixture, (0.0, 0.15)),
    "array_mixture": Case("array_mixture", array_mixture, (0.0, 0.1)),
    "relative": Case("relative", relative, (0.0, 0.02)),
    "setting": Case("setting", setting, (0.0, 0.02)),
    "relative_mixture": Case("relative_mixture", relative_mixture, (0.0, 0.05)),
    "relative_heading": Case("relative_heading", relative_heading, (0.0, 0.2)),
    "kernels": Case("kernels", kernels, (0.0, 0.04)),
    "logs": Case("logs", logs, (0.0, 0.1)),
    "regions": Case("regions", regions, (0.0, 0.1)),
    "turned": Case("turned", turned, (0.0, 0.05)),
    "choices": Case("choices", choices, (0.0, 0.2), probability_of_surfaces=_of_surfaces((7, 3), (1, 4))),
    "shelf": Case("shelf", shelf, (0.0, 0.05)),
    "counts_3": Case("counts", counts(3), (0.0, 0.05), count=3),
    "counts_5": Case("counts", counts(5), (0.0, 0.05), count=5),
    "outside": Case("outside", outside, (0.0, 0.1)),
    "crowd": Case("crowd", crowd, (0.0, 0.1)),
    "boxes": Case("boxes", boxes, (0.0, 0.1)),
    "rare": Case("rare", rare, (0.0, 0.005)),
}
