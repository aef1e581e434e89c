"""What phi says: closeTo, rightOf and leftOf(mug, plate) while the mug moves round the plate (Fig. 3)."""

from __future__ import annotations

import numpy as np

from experiments.charts import check_libraries
from experiments.figures.around import around
from experiments.measure import Array, phi_of
from experiments.page import picture, table
from experiments.pictures import pictures
from experiments.plan import Plan
from experiments.report import Report
from scenegen.api.spec import parse

TEXT = """object mug, plate
close: closeTo(mug, plate)
right: rightOf(mug, plate)
left: leftOf(mug, plate)
"""
WORDS = ("closeTo(mug, plate)", "rightOf(mug, plate)", "leftOf(mug, plate)")
PLATE = (0.5, 0.45)
REACH, BULGE = 0.4, 0.18  # metres: half the way's width, and how far it passes behind the plate
POINTS = 201
SHOWN = (0.0, 0.25, 0.5, 0.75, 1.0)


def way(points: int) -> tuple[Array, Array]:
    """The share of the way (n,), and the scenes (6, n): half an ellipse behind the plate, from left to right."""
    share = np.linspace(0.0, 1.0, points)
    rows = np.zeros((6, points))
    rows[0] = PLATE[0] - REACH * np.cos(np.pi * share)
    rows[1] = PLATE[1] + BULGE * np.sin(np.pi * share)
    rows[3], rows[4] = PLATE[0], PLATE[1]
    return share, rows


def run(plan: Plan) -> Report:
    """Fig. 3, and the values at five places."""
    check_libraries()
    spec = parse(TEXT, "semantics.spec")
    share, rows = way(POINTS)
    phi = phi_of(spec, rows)
    picked = [round(at * (POINTS - 1)) for at in SHOWN]
    size = plan.sizes.pixels
    drawn = pictures(spec, rows[:, picked], "top", (size, size))
    image = around(
        share, dict(zip(WORDS, phi, strict=True)), list(zip(share[picked].tolist(), drawn, strict=True)), rows[0]
    )
    distance = np.hypot(rows[0] - rows[3], rows[1] - rows[4])
    lines = [
        [f"{share[one]:.0%}".replace("%", " %"), f"{rows[0, one]:.3f}", f"{distance[one]:.3f}"]
        + [f"{value:+.3f}" for value in phi[:, one]]
        for one in picked
    ]
    blocks = {
        "fig3": picture("semantics_fig3.png", "Fig. 3 of the paper"),
        "values": table(["way", "x of the mug", "distance", *WORDS], lines),
    }
    data = {"share": share[picked].tolist(), "phi": {w: p[picked].tolist() for w, p in zip(WORDS, phi, strict=True)}}
    return Report("semantics", "What phi says", blocks, data, {"semantics_fig3.png": image})
