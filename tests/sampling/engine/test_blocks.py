"""Blocks of scenes: even over the cells, each scene once, the first ones of every cell, whatever the pieces. The file
of a run, packed while scenes are drawn, with the same bytes. A real sampler's pieces, scored by torch, streamed and
re-scored by another evaluator. Memory that is kept: fewer page faults, unless the user has decided otherwise.
"""

import ctypes
import dataclasses
import errno
import itertools
import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenegen.api.reading import read_scenes
from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import evaluate
from scenegen.errors import OutputError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import gate
from scenegen.processes.process import MALLOC_VARIABLES, environment
from scenegen.sampling.engine.blocks import BlockAssembler
from scenegen.sampling.engine.engines import Local, ShardWriter
from scenegen.sampling.engine.writer import folder_of, write_file
from scenegen.sampling.plan import Tally
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.blocks import Block
from scenegen.scenes.data import RequestData
from scenegen.scenes.sets import RAW, Manifest, header_data

from ...laws import examples


def offered(cells):
    """Candidates that know their cell and their number: rows (3, m), phi (1, m)."""
    cells = np.asarray(cells, dtype=np.intp)
    numbers = np.arange(len(cells), dtype=np.float64)
    return Block(np.stack([numbers, cells.astype(np.float64), numbers]), cells[None].astype(np.float64)), cells


def filled(assembler, cells, cuts=()):
    """The blocks that a assembler makes of candidates in these cells, offered in pieces that end at `cuts`."""
    block, index = offered(cells)
    ends = [0, *sorted(cuts), len(cells)]
    return [
        done
        for start, stop in itertools.pairwise(ends)
        for done in assembler.offer(block.part(start, stop), index[start:stop])
    ]


CELLS = st.lists(st.integers(-1, 6), max_size=400)
REACHED = st.sets(st.integers(0, 6), min_size=1)


@settings(deadline=None, max_examples=examples(100))
@given(CELLS, REACHED, st.integers(1, 60), st.integers(1, 25), st.lists(st.integers(0, 400), max_size=6))
def test_laws(cells, reached, wanted, size, cuts):
    assembler = BlockAssembler(sorted(reached), wanted, 5, size)
    blocks = filled(assembler, cells, [min(cut, len(cells)) for cut in cuts])
    rest = assembler.rest()
    # each block has its size, and is as even as whole numbers allow; so are all blocks up to it
    if len(reached) > 1:
        assert all(block.count == min(size, wanted - k * size) for k, block in enumerate(blocks))
    else:  # those of a single cell may leave in parts, none of which ends beyond a block
        ends = [0, *itertools.accumulate(block.count for block in blocks)]
        assert all((last - 1) // size == first // size for first, last in itertools.pairwise(ends))
    for together in ([block] for block in blocks), itertools.accumulate([block] for block in blocks):
        for some in together:
            counts = [sum(int((block.rows[1] == cell).sum()) for block in some) for cell in reached]
            assert max(counts) - min(counts) <= 1 and sum(counts) == sum(block.count for block in some)
    # nothing twice, nothing from elsewhere, nothing more than is wanted, rows and phi still belong together
    everything = [*blocks, *([rest] if rest is not None else [])]
    numbers = np.concatenate([np.empty(0), *(block.rows[0] for block in everything)]).astype(int)
    assert len(set(numbers)) == len(numbers) == assembler.done <= wanted
    assert all(cells[number] in reached for number in numbers)
    assert all((block.rows[1] == block.phi[0]).all() and (block.rows[0] == block.rows[2]).all() for block in everything)
    # within a cell they are handed out in the order in which they came
    for cell in reached:
        firsts = [block.rows[0][block.rows[1] == cell] for block in blocks]
        assert all(one.max() < other.min() for one, other in itertools.pairwise(filter(len, firsts)))
    assert assembler.candidates == sum(cell in reached for cell in cells)
    assert assembler.strays == {cell for cell in cells if cell >= 0 and cell not in reached}


@settings(deadline=None, max_examples=examples(100))
@given(CELLS, REACHED, st.integers(1, 60), st.integers(1, 25), st.data())
def test_going_on_from_a_state_changes_nothing(cells, reached, wanted, size, data):
    cut = data.draw(st.integers(0, len(cells)))
    one = BlockAssembler(sorted(reached), wanted, 5, size)
    expected = filled(one, cells, [cut])
    before = BlockAssembler(sorted(reached), wanted, 5, size)
    block, index = offered(cells)
    found = list(before.offer(block.part(0, cut), index[:cut]))
    after = BlockAssembler(sorted(reached), wanted, 5, size)
    after.restore(*before.state(), 3)
    assert after.count == before.count
    found += after.offer(block.part(cut, len(cells)), index[cut:])
    assert [block.rows.tobytes() for block in found] == [block.rows.tobytes() for block in expected]
    assert after.state()[0] == one.state()[0] and np.array_equal(after.state()[1], one.state()[1])


def test_the_first_of_each_cell_are_kept():
    """Room in a cell is that of two blocks; the next ones are dropped until a block has left."""
    assembler = BlockAssembler([0, 1], 40, 0, 10)
    assert filled(assembler, [0] * 15) == [] and assembler.count == 10
    (block,) = filled(assembler, [1] * 5)
    assert sorted(block.rows[0][block.rows[1] == 0]) == [0, 1, 2, 3, 4]


def test_a_rare_cell_does_not_fill_the_memory():
    source = np.random.default_rng(0)
    assembler = BlockAssembler([0, 1], 10**6, 0, 100)
    for _ in range(50):
        filled(assembler, (source.random(1000) < 0.001).astype(int))
        assert assembler.count - assembler.done <= 200
    assert 0 < assembler.done < 10**6


def test_blocks_are_shuffled_each_in_its_own_way():
    assembler = BlockAssembler([0, 1, 2, 3], 8000, 3, 4000)
    one, other = filled(assembler, np.arange(8000) % 4)
    assert not np.array_equal(one.rows[1], other.rows[1])
    for block in (one, other):
        follows = (np.diff(block.rows[0]) > 0).mean()
        assert 0.45 < follows < 0.55
        table = np.histogram2d(block.rows[1], np.arange(4000), bins=(4, 10))[0]
        assert ((table - 100) ** 2 / 100).sum() < 60  # chi-square, 27 degrees of freedom: beyond it once in 4,000


def test_the_odd_scene_goes_to_cells_all_over_the_range():
    assembler = BlockAssembler(range(32), 8, 0, 100)
    (block,) = filled(assembler, list(range(32)))
    assert np.diff(np.sort(block.rows[1])).max() <= 8


def test_no_cell():
    with pytest.raises(ValueError, match="no cell"):
        BlockAssembler([], 10, 0)


def test_groups_of_cells_have_equal_shares_and_their_cells_equal_shares_of_these():
    groups = [[0, 1, 2, 3], [4], [5, 6]]
    assembler = BlockAssembler(range(7), 1200, 3, 400, groups)
    cell = np.random.default_rng(0).permutation(np.arange(7).repeat(1200))
    blocks = list(assembler.offer(Block(cell[None].astype(float), cell[None].astype(float)), cell))
    for block in blocks:
        found = np.bincount(block.rows[0].astype(int), minlength=7)
        assert all(abs(sum(found[group]) - 400 / 3) < 1 for group in groups)
        assert all(np.ptp(found[group]) <= 1 for group in groups)
    assert assembler.complete and len(blocks) == 3


def test_groups_have_their_weights_in_every_block():
    groups, weights = [[0, 1, 2], [3], [4, 5]], [5, 1, 4]
    assembler = BlockAssembler(range(6), 1200, 3, 400, groups, weights)
    cell = np.random.default_rng(0).permutation(np.arange(6).repeat(1200))
    blocks = list(assembler.offer(Block(cell[None].astype(float), cell[None].astype(float)), cell))
    for block in blocks:
        found = np.bincount(block.rows[0].astype(int), minlength=6)
        assert [sum(found[group]) for group in groups] == [200, 40, 160]
        assert all(np.ptp(found[group]) <= 1 for group in groups)
    assert assembler.complete and len(blocks) == 3


SMALL = {"checkpoint": 0.0, "size": 300}


@pytest.mark.parametrize("workers", [1, 2])
def test_a_file_that_is_packed_ahead_goes_on(workers, tmp_path, unbroken):
    """With two workers the file is written while scenes are drawn: again from the first one in a run that goes on."""
    from made import Made, stream

    path = tmp_path / "x.parquet"
    asked = iter([False, False, True])
    stream(path, Made(2000), workers=2, spent=lambda: next(asked), **SMALL)
    folder = folder_of(path)
    assert not path.exists() and not list(folder.glob(".*")) and not (folder / "joined").exists()
    (folder / ".joined.abc.part").write_bytes(b"of a run that died")
    asked = iter([False, True])
    stream(path, Made(2000), workers=workers, spent=lambda: next(asked), resume=True, **SMALL)
    assert not list(folder.glob(".*"))
    stream(path, Made(2000), workers=workers, resume=True, **SMALL)
    assert path.read_bytes() == unbroken[".parquet"] and [one.name for one in tmp_path.iterdir()] == [path.name]


def test_a_part_of_a_file_that_was_packed_ahead(tmp_path):
    from made import Made, stream

    for workers in (1, 2):
        asked = iter([False, False, True])
        path = tmp_path / f"{workers}.parquet"
        stream(path, Made(2000), workers=workers, spent=lambda: next(asked), keep_partial=True, **SMALL)  # noqa: B023
    assert (tmp_path / "1.parquet").read_bytes() == (tmp_path / "2.parquet").read_bytes()


def test_a_file_that_cannot_be_packed_ends_the_run(tmp_path, unbroken):
    """It is said, and what was drawn until then is kept."""
    from made import Made, stream

    path, seen = tmp_path / "x.parquet", []

    def full(block):
        seen.append(block.count)
        if len(seen) == 3:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(OutputError, match=r"no space left(.|\n)*keeps") as caught:
        stream(path, Made(2000), workers=2, joining=full, **SMALL)
    assert "`resume`" in caught.value.diagnostics[0].help and not path.exists()
    stream(path, Made(2000), workers=2, resume=True, **SMALL)
    assert path.read_bytes() == unbroken[".parquet"]


@pytest.fixture
def spec():
    """A requirement beside the label: the last row of phi, which no file holds. Here it is the second label."""
    whole = check_text("object mug, plate\ntask: leftOf(mug, plate)\nsafe: farFrom(mug, plate)\n", "two.spec")
    labels = dict(whole.core.labels)
    core = dataclasses.replace(whole.core, labels={"task": labels["task"]}, requirement=labels["safe"])
    return dataclasses.replace(whole, core=core)


def streamed(path, spec, workers):
    from rejected import Rejected

    problem = make_problem(spec, SampleRequest({"task": Range(0.0, 0.3)}, n=20_000, seed=9))
    request = RequestData(phi={"task": (0.0, 0.3)}, n=20_000)

    def header(tally):
        draws = tally.pieces * problem.piece_size
        return make_header(spec, {"method": "rejection", "seed": 9, "draws": draws}, request)

    plan, first = Rejected(problem), header(Tally(0, 0, 0, 0))
    facts = {"spec": spec.sha256, "phi": request.phi, "n": 20_000, "seed": 9, "spread": "flat"}
    manifest = Manifest(
        request={**facts, "scenegen": "", "numpy": ""}, labels=["task"], shard_size=12_000, header=header_data(first)
    )
    writing = lambda store: ShardWriter(plan, store, first, spec.labels, ending=RAW)  # noqa: E731
    with Local(workers) as engine:
        return write_file(path, plan, engine, manifest, writing, header, block=6000)


def test_scenes_are_those_asked_for(tmp_path, spec):
    tally = streamed(tmp_path / "x.parquet", spec, 1)
    scenes = read_scenes(tmp_path / "x.parquet")
    assert len(scenes) == tally.scenes == 20_000 and list(scenes.phi) == ["task"]
    assert scenes.header.sampler["draws"] == 65_536 * tally.pieces
    np.testing.assert_array_equal(evaluate(spec, scenes)["task"], scenes.phi["task"])
    poses = scenes.poses
    assert np.hypot(*(poses[:, 0, :2] - poses[:, 1, :2]).T).min() >= 0.25 - 1e-12
    assert gate(spec.core) is not spec.core
    counts = np.histogram(scenes.phi["task"], bins=32, range=(0.0, 0.3))[0]
    assert counts.min() == counts.max() == 625


@pytest.mark.slow
def test_workers_hand_out_the_same_bytes(tmp_path, spec):
    for workers in (1, 2, 5):
        streamed(tmp_path / f"{workers}.parquet", spec, workers)
    one, two, five = (path.read_bytes() for path in sorted(tmp_path.iterdir()))
    assert one == two == five


PROGRAM = """
import resource, sys
import numpy as np
from scenegen.processes.process import keep_memory
if sys.argv[1] == "kept":
    keep_memory()
for _ in range(100):  # four arrays of 1 MB that come and go
    arrays = [np.ones(1 << 17) for _ in range(4)]
    del arrays
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(100):
    arrays = [np.ones(1 << 17) for _ in range(4)]
    del arrays
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(how, **more):
    env = {name: value for name, value in os.environ.items() if name not in MALLOC_VARIABLES} | more
    run = subprocess.run([sys.executable, "-c", PROGRAM, how], capture_output=True, text=True, env=env, check=True)
    return int(run.stdout)


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="not glibc")
def test_pages_are_kept_for_the_next_arrays():
    free = faults("left", MALLOC_TRIM_THRESHOLD_="131072")
    assert free > 10_000 and faults("kept") < 0.1 * free
    assert faults("kept", MALLOC_TRIM_THRESHOLD_="131072") > 10_000  # the user has said so


def test_workers_keep_theirs_unless_the_environment_says_otherwise(monkeypatch):
    for name in MALLOC_VARIABLES:
        monkeypatch.delenv(name, raising=False)
    assert MALLOC_VARIABLES.items() <= environment().items()
    monkeypatch.setenv("MALLOC_TRIM_THRESHOLD_", "1000")
    assert environment()["MALLOC_TRIM_THRESHOLD_"] == "1000"
