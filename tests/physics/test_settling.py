"""Settling between a sampler's pieces and the runner: n scenes, even over the cells, whatever breaks and workers."""

from contextlib import closing
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.geometry import Box
from scenegen.sampling.engine.blocks import BlockAssembler, run_blocks
from scenegen.sampling.plan import Account, Piece, Plan
from scenegen.sampling.request import Cells, SampleRequest
from scenegen.scenes.blocks import Block
from scenegen.search.effort import StoppedError
from scenegen.things import Shape
from scenegen.worlds.physics.settling import Settling
from tests.physics.drops import settle_scenes

SHAPES = (Shape("box", Box(0.1, 0.1), 0.1), Shape("box", Box(0.1, 0.1), 0.1))
NAMES = ("red", "blue")


EDGES = np.linspace(0.07, 0.15, 5)
CELLS = Cells(labels=("task",), low=EDGES[:1], high=EDGES[-1:], bounded=(0,), edges=(EDGES,))


@dataclass(frozen=True, slots=True, eq=False)
class Fake(Plan):
    """Two boxes side by side along x; phi is their distance, so that the nearest cells hold overlaps."""

    digest: str = "fake"

    method = "fake"
    reached = (0, 1, 2, 3)
    evaluations = scenes_per_piece = 60.0
    fact_count = 1

    @property
    def plan_digest(self):
        return self.digest

    def draw(self, k):
        draw = np.random.default_rng((self.seed, k)).uniform(0.0, 0.2, 60)
        rows = np.zeros((6, 60))
        rows[0], rows[1] = 0.3 + 0.001 * k, 0.5
        rows[3], rows[4] = rows[0] + draw, 0.5
        phi = draw[None]
        return Piece(rows, phi, self.cells.find(phi), np.array([1.0]))

    def account(self, tally):
        return Account({"pieces": tally.facts[0]}, "")


def fake(n, digest="fake"):
    spec = SimpleNamespace(objects=NAMES, shapes=SHAPES, fixed={}, regions=(), declares_heights=False)
    problem = SimpleNamespace(spec=spec, request=SampleRequest(n=n, seed=5), cells=CELLS, scenes=lambda rows: rows)
    return Fake(problem, digest)


def settling(plan, workers=1):
    return Settling(plan.problem, plan, workers)


def _run(plan, workers=2):
    """The scenes, their phi, and what is said of the run."""
    settled = settling(plan, workers)
    blocks = []
    with closing(settled):
        run = run_blocks(settled, 1)
        try:
            while True:
                blocks.append(next(run))
        except StopIteration as end:
            tally = end.value
    rows = np.concatenate([block.rows for block in blocks], axis=1)
    return rows, np.concatenate([block.phi for block in blocks], axis=1), tally, settled.account(tally)


@pytest.mark.long
def test_all_that_are_wanted_settle_and_cells_get_equal_shares():
    rows, phi, tally, account = _run(fake(40))
    assert rows.shape == (6, 40)
    assert settle_scenes(SHAPES, rows.T.reshape(40, 2, 3), workers=1).kept.all()
    assert np.bincount(CELLS.find(phi), minlength=4).tolist() == [10, 10, 10, 10]
    dropped, refused, *moved, _ = tally.facts
    assert refused > 0 and dropped < 40 + 8 * refused and max(moved) <= refused
    (warning,) = account.warnings
    assert warning.title.startswith(f"{refused:.0f} of {dropped:.0f} scenes did not settle") and account.note
    assert account.info == {"pieces": tally.pieces, "settled": True}
    again, _, same, _ = _run(fake(40), workers=1)
    assert (again == rows).all() and same == tally


@pytest.mark.long
def test_within_a_cell_those_kept_are_the_first_candidates_that_settle():
    """The oracle settles everything and fills cells in order."""
    plan = fake(24)
    pieces = [plan.draw(k) for k in range(6)]
    rows = np.concatenate([piece.rows for piece in pieces], axis=1)
    phi = np.concatenate([piece.phi for piece in pieces], axis=1)
    at_once = 9  # half as many again as the six of a cell
    first = np.concatenate([_first(piece.cell, at_once) for piece in pieces])
    rows, phi = rows[:, first], phi[:, first]
    kept = settle_scenes(SHAPES, rows.T.reshape(-1, 2, 3), workers=2).kept
    cell = np.where(kept, CELLS.find(phi), -1)
    wanted = np.sort(np.concatenate([phi[0, np.flatnonzero(cell == one)[:6]] for one in range(4)]))
    assert np.sort(_run(plan)[1][0]) == pytest.approx(wanted, abs=0.0)


def _first(cell, count):
    kept = np.zeros(len(cell), dtype=bool)
    for one in range(4):
        kept[np.flatnonzero(cell == one)[:count]] = True
    return kept


@pytest.mark.long
def test_a_run_that_breaks_and_goes_on_gives_the_same_scenes():
    """As `stream_scenes` does it: the assembler is restored, what settles begins again."""
    plan = fake(32)

    def fill(assembler, start, stop):
        out = []
        with closing(settling(plan)) as settled:
            for k in range(start, stop):
                if assembler.complete:
                    break
                piece = settled.draw(k)
                out += list(assembler.offer(Block(piece.rows, piece.phi), piece.cell))
        return out

    whole = fill(BlockAssembler(plan.reached, 32, plan.seed), 0, 100)
    first = BlockAssembler(plan.reached, 32, plan.seed)
    assert fill(first, 0, 1) == []
    second = BlockAssembler(plan.reached, 32, plan.seed)
    second.restore(*first.state(), 6)
    rest = fill(second, 1, 100)
    assert len(whole) == len(rest) == 1
    assert (whole[0].rows == rest[0].rows).all()


def test_only_earlier_pieces_make_a_cell_full():
    """Pieces may be drawn in any order: one whose worker died is drawn by another one later."""
    with closing(settling(fake(4))) as settled:
        last, first = settled.draw(3), settled.draw(0)
        again = settled.draw(3)
    with closing(settling(fake(4))) as fresh:
        assert fresh.draw(0).rows.tobytes() == first.rows.tobytes()
    assert last.rows.shape[1] > 0 and again.rows.shape[1] < last.rows.shape[1]


def test_a_run_with_settling_is_not_resumed_without():
    assert settling(fake(8)).plan_digest != fake(8).plan_digest
    assert settling(fake(8)).plan_digest != settling(fake(8, "x")).plan_digest


def test_dropping_ends_when_its_time_is_up():
    """After the round in which that is; a piece of hundreds of scenes would take seconds more."""
    looks = []

    class Late:
        def check(self):
            looks.append(1)
            if len(looks) == 2:
                raise StoppedError

    plan = fake(200)
    with closing(Settling(plan.problem, plan, 1, Late())) as late, pytest.raises(StoppedError):
        late.draw(0)
    assert len(looks) == 2
    with closing(Settling(plan.problem, plan, 1)) as never:  # a settler that was broken off leaves nothing behind
        assert len(never.draw(0).cell) > 0
