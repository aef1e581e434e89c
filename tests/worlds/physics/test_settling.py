"""Settling: what rests is kept, what stands in something else is not; blame, determinism, processes, blocks, pieces.
Scenes that differ in how many things there are, or which: settled as scenes of fixed numbers are. Settling between
a sampler's pieces and the runner: n scenes, even over the cells, whatever breaks and workers.
"""

import json
import subprocess
import sys
import textwrap
from contextlib import closing
from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest

import scenegen
from scenegen.errors import RequestError, ScenegenError
from scenegen.geometry import NUMPY, PRIMITIVES, Box, Circle, Polygon
from scenegen.processes import process
from scenegen.sampling.cells import Cells
from scenegen.sampling.engine.blocks import BlockAssembler, run_blocks
from scenegen.sampling.plan import Account, Piece, Plan
from scenegen.sampling.request import SampleRequest
from scenegen.scenes.blocks import Block
from scenegen.search.effort import StoppedError
from scenegen.things import Shape, shape_of
from scenegen.things.surfaces import base_heights
from scenegen.worlds.physics.bodies import is_still
from scenegen.worlds.physics.settling import Displacements, Refusals, Settler, Settling
from tests.worlds.physics.drops import settle_scenes

NAMES = ("plate", "mug", "knife", "crackerbox", "bottle")
SHAPES = tuple(map(shape_of, NAMES))


def _box(length, width, height):
    return Shape("box", Box(length, width), height)


def _rod(radius, height):
    return Shape("cylinder", Circle(radius), height)


def _one(shapes, poses, fixed=()):
    """What becomes of one scene."""
    return settle_scenes(shapes, np.array([poses], dtype=np.float64), fixed=fixed, workers=1)


def _gap(shapes, poses):
    """(scenes,): the smallest clearance of two objects of a scene."""
    gap = PRIMITIVES["gap"].evaluate
    rows = poses.transpose(1, 2, 0)
    pairs = [(a, b) for a in range(len(shapes)) for b in range(a)]
    found = [gap(NUMPY, shapes[a].footprint, shapes[b].footprint, *rows[a], *rows[b]) for a, b in pairs]
    return np.min(found, axis=0)


@pytest.fixture(scope="module")
def random():
    """Scenes of five objects from the base distribution, and what becomes of them."""
    poses = np.random.default_rng(11).uniform((0, 0, 0), (1, 1, 2 * np.pi), size=(160, len(NAMES), 3))
    return poses, settle_scenes(SHAPES, poses, workers=2)


@pytest.mark.long
def test_scenes_without_overlap_settle_and_hardly_stir(random):
    poses, found = random
    apart = _gap(SHAPES, poses) >= 0.0
    assert apart.sum() > 20
    assert found.stays[apart].all()
    assert found.shift[apart].max() < 0.001 and found.turn[apart].max() < 1.0


@pytest.mark.long
def test_scenes_with_deep_overlap_of_tall_things_do_not(random):
    """Two bodies that are 3 cm deep in each other part by that much together, so that one moves 1.5 cm or more: up, if
    the other is low, so only tall ones are looked at, where none carries another."""
    poses, found = random
    tall = [NAMES.index(name) for name in ("mug", "crackerbox", "bottle")]
    shapes = [SHAPES[k] for k in tall]
    deep = (_gap(shapes, poses[:, tall]) < -0.03) & ~base_heights(shapes, poses[:, tall]).any(axis=1)
    assert deep.sum() > 3
    assert not found.stays[deep].any()


@pytest.mark.long
def test_things_alone_rest_whatever_their_form():
    """Thin posts and sheets stand upright: nothing tips them."""
    shapes = [
        _box(0.01, 0.01, 0.3),
        _box(0.001, 0.3, 0.4),
        _rod(0.002, 0.3),
        _box(0.001, 0.001, 0.001),
        _box(0.3, 0.3, 0.0005),
        _box(5.0, 5.0, 5.0),
        _rod(0.037, 0.072),
        Shape("prism", Polygon(((0.0, 0.0), (0.3, 0.0), (0.05, 0.02))), 0.1),  # its origin is a corner
    ]
    found = _one(shapes, [(10.0 * k, 0.0, 1.0) for k in range(len(shapes))])
    assert not found.moved.any()


def test_a_block_on_the_edge_of_a_sheet_leans_as_trigonometry_says_and_a_post_falls():
    """A block 20 cm long whose middle is over the edge rests on that edge, 10 cm from its other end, unless that turns
    it by more than 5 degrees: asin(8 mm / 10 cm) is 4.6, asin(9.5 mm / 10 cm) is 5.5."""
    block, post = _box(0.2, 0.2, 0.05), _box(0.02, 0.02, 0.4)
    for height, settles in ((0.004, True), (0.008, True), (0.0095, False)):
        sheet = _box(0.2, 0.2, height)
        found = _one([sheet, block], [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)], fixed={0})
        assert found.stays[0] == settles
        if settles:
            assert found.turn[0, 1] == pytest.approx(np.degrees(np.arcsin(height / 0.1)), abs=0.2)
    found = _one([_box(0.2, 0.2, 0.004), post], [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)], fixed={0})
    assert found.moved.tolist() == [[False, True]]


def test_fixed_objects_stay_and_push():
    shapes = [_box(0.1, 0.1, 0.1), _box(0.1, 0.1, 0.1)]
    poses = [(0.0, 0.0, 0.0), (0.06, 0.0, 0.0)]
    one = _one(shapes, poses, fixed={0})
    assert one.moved.tolist() == [[False, True]] and one.shift[0, 0] == one.turn[0, 0] == 0.0
    both = _one(shapes, poses, fixed={0, 1})
    assert both.stays[0] and not both.shift.any()


def test_what_lies_wholly_on_a_tray_rests_on_it_and_what_overhangs_is_thrown_off():
    shapes = [_rod(0.03, 0.1), _box(0.4, 0.3, 0.05), *(_box(0.1 - 0.01 * k, 0.1, 0.1 - 0.01 * k) for k in range(3))]
    tower = [(-0.1, 0.0, 0.3)] * 3
    on = [(0.1, 0.0, 0.0), (0.0, 0.0, 0.0), *tower]
    over = [(0.2, 0.0, 0.0), (0.0, 0.0, 0.0), *tower]
    found = settle_scenes(shapes, np.array([on, over]), fixed={1}, workers=1)
    assert found.stays.tolist() == [True, False]
    assert found.moved[1].tolist() == [True, False, False, False, False]


def test_neighbours_that_touch_rest():
    shapes = [*[_box(0.1, 0.1, 0.1)] * 5, *[_rod(0.05, 0.1)] * 5]
    assert _one(shapes, [(0.1 * (k % 5), float(k // 5), 0.0) for k in range(10)]).stays[0]


def test_where_the_table_lies_does_not_matter():
    poses = np.array([[(0.0, 0.0, 0.0), (0.055, 0.0, 1.0)]])
    near = settle_scenes([_rod(0.05, 0.1), _box(0.1, 0.05, 0.1)], poses, workers=1)
    far = settle_scenes([_rod(0.05, 0.1), _box(0.1, 0.05, 0.1)], poses + np.array([1000.0, -500.0, 0.0]), workers=1)
    assert not near.stays.any() and not far.stays.any()
    assert (near.moved == far.moved).all()


@pytest.mark.long
def test_one_worker_or_more_alone_or_together_in_any_order_the_same_bits(random):
    poses, found = random
    some = slice(0, 70)
    backwards = settle_scenes(SHAPES, poses[some][::-1], workers=3)
    assert (backwards.shift[::-1] == found.shift[some]).all() and (backwards.turn[::-1] == found.turn[some]).all()
    with Settler(SHAPES, workers=1) as settler:
        for k in (7, 3, 90):
            alone = settler.settle(poses[k : k + 1])
            assert (alone.shift[0] == found.shift[k]).all() and (alone.turn[0] == found.turn[k]).all()


def test_limits_hold_at_their_ends_and_never_for_nan():
    shift = np.array([0.01, 0.0100001, 0.0, np.nan, 0.0])
    turn = np.array([5.0, 0.0, 5.0001, 0.0, np.nan])
    assert is_still(shift, turn).tolist() == [True, False, False, False, False]


def test_no_scenes_are_no_work():
    found = settle_scenes(SHAPES, np.empty((0, 5, 3)))
    assert found.stays.shape == (0,) and found.moved.shape == (0, 5)


def test_refusals_are_counted_by_object():
    shift = np.zeros((6, 3))
    shift[0, 1] = shift[1, 1] = shift[1, 2] = 0.02
    turn = np.zeros((6, 3))
    turn[2, 1] = 6.0
    names = ("plate", "mug", "fork")
    assert Refusals(names, 2, 0, (0, 0, 0)).diagnostic() is None
    found = Displacements(shift, turn)
    assert found.moved.sum(axis=0).tolist() == [0, 3, 1] and found.stays.tolist() == [False] * 3 + [True] * 3
    refusals = Refusals(names, 8, 3, (0, 3, 1))
    assert refusals.summary() == "3 of 8 scenes did not settle: `mug` moved in 3, `fork` in 1"
    warning = refusals.diagnostic()
    assert warning.severity == "warning" and not warning.help
    assert "noOverlap" in Refusals(names, 8, 5, (1, 3, 2)).diagnostic().help


def test_fewer_workers_than_one_are_refused():
    with pytest.raises(RequestError, match="`workers` is 0"):
        Settler(SHAPES, workers=0)


def test_a_process_that_dies_is_a_diagnostic(monkeypatch):
    program = [sys.executable, "-c", "import sys; sys.exit('out of gravity')"]
    monkeypatch.setattr(process, "command", lambda module, load=(): program)
    with pytest.raises(ScenegenError, match="out of gravity"):
        settle_scenes(SHAPES, np.zeros((40, 5, 3)), workers=2)


@pytest.mark.long
def test_standard_output_stays_clean_and_the_caller_free_of_pybullet():
    script = textwrap.dedent(
        """
        import sys
        import numpy as np
        from scenegen.things import shape_of
        from scenegen.worlds.physics.settling import Settler
        with Settler([shape_of("mug")], workers=1) as settler:
            found = settler.settle(np.zeros((1, 1, 3)))
        print(found.stays.tolist(), "pybullet" in sys.modules)
        """
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("[True] False\n", "")


SPEC = """object tray, plate, block[2..4] = box(4 cm, 4 cm, 4 cm), cup on any of [plate.inside, tray.inside]
require noCollision()
task: forall b in block: closeTo(b, plate, 35 cm)
"""


@pytest.fixture(scope="module")
def scenes():
    return scenegen.sample(scenegen.parse(SPEC), (0.0, None), n=9, seed=1, workers=1)


@pytest.fixture(scope="module")
def settled(scenes):
    return scenegen.settle(scenes, workers=1)


@pytest.mark.long
def test_each_scene_is_settled_as_if_there_were_no_others(scenes, settled):
    assert set(scenes.counts["block"]) == {2, 3, 4}
    for k in (0, 4, 8):
        alone = scenegen.settle(scenes[k : k + 1], workers=1)
        np.testing.assert_array_equal(settled.poses[k], alone.poses[0])
        np.testing.assert_array_equal(settled.shift[k], alone.shift[0])
        assert settled.phi["task"][k] == alone.phi["task"][0] == pytest.approx(scenes[k].phi["task"], abs=1e-4)
        assert settled.contacts[k] == alone.contacts[0]


@pytest.mark.long
def test_objects_that_are_not_there_are_none(scenes, settled, tmp_path):
    assert np.array_equal(np.isnan(settled.poses).any(axis=2), ~scenes.present)
    assert settled.settled.all()
    assert "9 of 9 scenes settled" in repr(settled)
    table = pq.read_table(settled.save(tmp_path / "a.parquet")).to_pydict()
    assert [value is None for value in table["block[4].x"]] == (scenes.counts["block"] < 4).tolist()
    data = json.loads(settled.save(tmp_path / "a.json").read_text())
    for scene, plan in zip(data["scenes"], scenes, strict=True):
        assert list(scene["objects"]) == list(plan.poses)


@pytest.mark.long
def test_the_command_takes_them(scenes, tmp_path, capsys):
    from scenegen.cli.app import run

    scenes.save(tmp_path / "a.jsonl")
    line = [
        "settle",
        str(tmp_path / "a.jsonl"),
        "--out",
        str(tmp_path / "b.jsonl"),
        "--in",
        "pybullet",
        "--workers",
        "1",
    ]
    assert run(line) == 0
    assert "9 of 9 scenes settled (pybullet" in capsys.readouterr().err
    assert len((tmp_path / "b.jsonl").read_text().splitlines()) == 10


SHAPES_SETTLING = (Shape("box", Box(0.1, 0.1), 0.1), Shape("box", Box(0.1, 0.1), 0.1))
NAMES_SETTLING = ("red", "blue")


EDGES = np.linspace(0.07, 0.15, 5)
CELLS = Cells(labels=("task",), low=EDGES[:1], high=EDGES[-1:], bounded=(0,), edges=(EDGES,))


@dataclass(frozen=True, slots=True, eq=False)
class Fake(Plan):
    """Two boxes side by side along x; phi is their distance, so that the nearest cells hold overlaps."""

    digest: str = "fake"

    method = "fake"
    reached_cells = (0, 1, 2, 3)
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
    spec = SimpleNamespace(objects=NAMES_SETTLING, shapes=SHAPES_SETTLING, fixed={}, regions=(), declares_heights=False)
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
    assert settle_scenes(SHAPES_SETTLING, rows.T.reshape(40, 2, 3), workers=1).stays.all()
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
    kept = settle_scenes(SHAPES_SETTLING, rows.T.reshape(-1, 2, 3), workers=2).stays
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
    """As `write_file` does it: the assembler is restored, what settles begins again."""
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

    whole = fill(BlockAssembler(plan.reached_cells, 32, plan.seed), 0, 100)
    first = BlockAssembler(plan.reached_cells, 32, plan.seed)
    assert fill(first, 0, 1) == []
    second = BlockAssembler(plan.reached_cells, 32, plan.seed)
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
