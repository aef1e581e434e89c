"""Settling between a sampler's pieces and the runner: n scenes, even over the cells, whatever breaks and workers."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from scenegen.assets import Shape
from scenegen.engine.blocks import Filler
from scenegen.engine.stream import run_blocks
from scenegen.formats.blocks import Block
from scenegen.primitives import Box
from scenegen.render.settle import Refusals, Settler, settle_scenes
from scenegen.render.settling import Settling
from scenegen.sampling.cells import Cells
from scenegen.sampling.pieces import Candidates

SHAPES = (Shape("box", Box(0.1, 0.1), 0.1), Shape("box", Box(0.1, 0.1), 0.1))
NAMES = ("red", "blue")


@dataclass(frozen=True)
class Fake:
    """Two boxes side by side along x; phi is their distance, so that the nearest cells hold overlaps."""

    wanted: int
    seed: int = 5
    plan_digest: str = "fake"
    fewest: int = 1
    patience: int | None = None
    reached: tuple[int, ...] = (0, 1, 2, 3)

    @property
    def cells(self):
        edges = np.linspace(0.07, 0.15, 5)
        return Cells(labels=("task",), low=edges[:1], high=edges[-1:], bounded=(0,), edges=(edges,))

    def piece(self, k):
        draw = np.random.default_rng((self.seed, k)).uniform(0.0, 0.2, 60)
        rows = np.zeros((6, 60))
        rows[0], rows[1] = 0.3 + 0.001 * k, 0.5
        rows[3], rows[4] = rows[0] + draw, 0.5
        phi = draw[None]
        return Candidates(rows, phi, self.cells.find(phi), np.zeros(0))


def _run(fake, workers=2):
    refusals = Refusals(NAMES)
    with Settler(SHAPES, workers=workers) as settler:
        blocks = list(run_blocks(Settling(fake, settler, refusals), 1))
    rows = np.concatenate([block.rows for block in blocks], axis=1)
    return rows, np.concatenate([block.phi for block in blocks], axis=1), refusals


def test_all_that_are_asked_for_settle_and_cells_get_equal_shares():
    rows, phi, refusals = _run(Fake(40))
    assert rows.shape == (6, 40)
    assert settle_scenes(SHAPES, rows.T.reshape(40, 2, 3), workers=1).kept.all()
    assert np.bincount(Fake(40).cells.find(phi), minlength=4).tolist() == [10, 10, 10, 10]
    assert refusals.refused > 0 and refusals.scenes < 40 + 8 * refusals.refused
    again, _, _ = _run(Fake(40), workers=1)
    assert (again == rows).all()


def test_within_a_cell_those_kept_are_the_first_candidates_that_settle():
    """The oracle settles everything and fills cells in order."""
    fake = Fake(24)
    pieces = [fake.piece(k) for k in range(6)]
    rows = np.concatenate([piece.rows for piece in pieces], axis=1)
    phi = np.concatenate([piece.phi for piece in pieces], axis=1)
    at_once = 9  # half as many again as the six of a cell
    first = np.concatenate([_first(piece.cell, at_once) for piece in pieces])
    rows, phi = rows[:, first], phi[:, first]
    kept = settle_scenes(SHAPES, rows.T.reshape(-1, 2, 3), workers=2).kept
    cell = np.where(kept, fake.cells.find(phi), -1)
    wanted = np.sort(np.concatenate([phi[0, np.flatnonzero(cell == one)[:6]] for one in range(4)]))
    assert np.sort(_run(fake)[1][0]) == pytest.approx(wanted, abs=0.0)


def _first(cell, count):
    kept = np.zeros(len(cell), dtype=bool)
    for one in range(4):
        kept[np.flatnonzero(cell == one)[:count]] = True
    return kept


def test_a_run_that_breaks_and_goes_on_gives_the_same_scenes():
    """As `stream_scenes` does it: the filler is restored, what settles begins anew."""
    fake = Fake(32)

    def fill(filler, start, stop):
        out = []
        with Settler(SHAPES, workers=1) as settler:
            settling = Settling(fake, settler, Refusals(NAMES))
            for k in range(start, stop):
                if filler.complete:
                    break
                piece = settling.piece(k)
                out += list(filler.offer(Block(piece.rows, piece.phi), piece.cell))
        return out

    whole = fill(Filler(fake.reached, 32, fake.seed), 0, 100)
    first = Filler(fake.reached, 32, fake.seed)
    assert fill(first, 0, 1) == []
    second = Filler(fake.reached, 32, fake.seed)
    second.restore(*first.state(), 6)
    rest = fill(second, 1, 100)
    assert len(whole) == len(rest) == 1
    assert (whole[0].rows == rest[0].rows).all()


def test_a_run_with_settling_is_not_resumed_without():
    with Settler(SHAPES, workers=1) as settler:
        settling = Settling(Fake(8), settler, Refusals(NAMES))
        assert settling.plan_digest != Fake(8).plan_digest
        assert settling.plan_digest != Settling(replace(Fake(8), plan_digest="x"), settler, Refusals(NAMES)).plan_digest
