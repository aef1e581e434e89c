"""Experiment 1 on uniform scenes: the published shares, P(task) = 25 % and P(both) = 21.1 %."""

import math

import torch

from scenegen.lang.checker import check_text
from scenegen.learn.robustness import Robustness
from scenegen.resources import shipped_specs

SCENES = 400_000


def test_the_shares_of_uniform_scenes():
    run = Robustness(check_text(shipped_specs()["mug_left_of_plate"].read_text(encoding="utf-8")).core)
    rows = torch.rand(6, SCENES, generator=torch.Generator().manual_seed(20240607), dtype=torch.float64)
    task, safe = run.rows(rows) >= 0.0
    # Of a square's pairs of points, those closer than e are pi e^2 - 8/3 e^3 + e^4 / 2 (e <= 1); by symmetry the four
    # quadrants have a quarter of the rest each.
    e = 0.25
    close = math.pi * e**2 - 8.0 / 3.0 * e**3 + e**4 / 2.0
    assert round((1.0 - close) / 4.0, 3) == 0.211
    for hits, share in (
        (task, 0.25),
        (~safe, close),
        (task & safe, (1.0 - close) / 4.0),
    ):
        z = (int(hits.sum()) - SCENES * share) / math.sqrt(SCENES * share * (1.0 - share))
        assert abs(z) < 3.5, (share, z)
