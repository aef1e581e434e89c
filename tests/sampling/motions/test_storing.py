"""Motions go the road of scenes: into files and sets that are gone on with, by any number of processes, and settled."""

import dataclasses
import itertools

import numpy as np
import pytest

import scenegen
from scenegen.api.request import check_request
from scenegen.api.scene_arrays import header_of, stored_form
from scenegen.errors import DataError, RequestError
from scenegen.sampling.engine.engines import Local, ShardWriter, open_engine
from scenegen.sampling.engine.writer import write_file, write_set
from scenegen.sampling.plans import plan_for
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes import sets
from scenegen.scenes.formats.registry import MOTION_FORMATS
from scenegen.scenes.formats.registry import read_motions as read
from scenegen.scenes.stores import store_at
from scenegen.search.effort import Budget

PASS = """object mug, plate at (0.5, 0.5)
time 3 steps
require speed(mug) <= 30 cm/s
task: eventually closeTo(mug, plate, 20 cm)
"""
SPEC = scenegen.parse(PASS)
PHI, N, SEED, BLOCK = (-0.1, 0.1), 300, 4, 64


@pytest.fixture(scope="module")
def plan():
    """One whose pieces are small."""
    request = check_request(SPEC, SampleRequest({"task": Range(*PHI)}, N, seed=SEED, workers=1))
    made = plan_for(SPEC.definition, request, Budget(1e6))
    small = dataclasses.replace(made.problem, cost=1 << 21)
    return dataclasses.replace(made, problem=small)


def begun(plan):
    """The header before the run, and the manifest."""
    header = header_of(plan.problem, {"method": plan.method})
    facts = {"spec": SPEC.checked.sha256 if SPEC.over_time is None else SPEC.definition.sha256, "phi": {"task": PHI}}
    facts |= {"n": N, "seed": SEED, "spread": "flat", "scenegen": "0", "numpy": np.__version__}
    return header, sets.Manifest(request=facts, labels=["task"], shard_size=2 * BLOCK, header=sets.header_data(header))


def stream(path, plan, workers=1, **options):
    header, manifest = begun(plan)
    info = lambda tally: header_of(plan.problem, plan.account(tally).info)  # noqa: E731
    form = stored_form(plan.problem)
    writing = lambda store: ShardWriter(plan, store, header, SPEC.labels, form, sets.RAW)  # noqa: E731
    with Local(workers) as engine:
        return write_file(path, plan, engine, manifest, writing, info, checkpoint=0.0, block=BLOCK, **options)


class Struck(Exception):  # noqa: N818 - stands for kill -9
    pass


def struck_at(piece):
    """Called after each piece."""
    count = itertools.count(1)

    def spent():
        if next(count) == piece:
            raise Struck
        return False

    return spent


@pytest.mark.parametrize("ending", MOTION_FORMATS)
def test_files_are_gone_on_with(ending, plan, tmp_path):
    assert plan.batch <= 32
    tally = stream(tmp_path / f"whole{ending}", plan)
    assert tally.pieces > 20
    with pytest.raises(Struck):
        stream(tmp_path / f"x{ending}", plan, spent=struck_at(15))
    assert not (tmp_path / f"x{ending}").exists()
    stream(tmp_path / f"x{ending}", plan, resume=True, workers=2)
    assert (tmp_path / f"x{ending}").read_bytes() == (tmp_path / f"whole{ending}").read_bytes()
    if ending != ".csv":
        found = read(tmp_path / f"x{ending}")
        assert found.poses.shape == (N, 4, 2, 3) and tuple(found.facts) == ("moved", "way")
        assert found.phi["task"].min() >= PHI[0] and found.phi["task"].max() <= PHI[1]


def to_set(folder, plan, engine, **options):
    store = store_at(str(folder))
    header, manifest = begun(plan)
    writing = ShardWriter(plan, store, header, SPEC.labels, stored_form(plan.problem))
    with engine:
        return write_set(
            store, plan, engine, manifest, writing, lambda tally: plan.account(tally).info, block=BLOCK, **options
        )[1]


def test_sets_are_gone_on_with(plan, tmp_path):
    stream(tmp_path / "x.parquet", plan)
    made = to_set(tmp_path / "whole", plan, open_engine("local", 1, plan))
    assert [shard.scenes for shard in made.shards] == [128, 128, 44] and made.complete
    file, found = read(tmp_path / "x.parquet"), scenegen.read_motions(tmp_path / "whole")
    assert file.poses.tobytes() == found.poses.tobytes() and file.phi["task"].tobytes() == found.phi["task"].tobytes()
    assert file.header == found.header
    with pytest.raises(Struck):
        to_set(tmp_path / "set", plan, open_engine("local", 1, plan), spent=struck_at(tally_of(plan) - 2))
    begun = sets.read_manifest(store_at(str(tmp_path / "set")))
    assert len(begun.shards) == 2 and not begun.complete
    one = dataclasses.replace(plan.problem.request, workers=2)
    two = dataclasses.replace(plan, problem=dataclasses.replace(plan.problem, request=one))
    to_set(tmp_path / "set", two, open_engine("local", 2, two), resume=True)
    names = sorted(path.name for path in (tmp_path / "whole").iterdir())
    assert names == sorted(path.name for path in (tmp_path / "set").iterdir())
    assert all((tmp_path / "set" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes() for name in names)


def tally_of(plan):
    """How many pieces the plan takes."""
    from scenegen.sampling.engine.blocks import run_blocks

    run = run_blocks(plan, 1, size=BLOCK)
    while True:
        try:
            next(run)
        except StopIteration as end:
            return end.value.pieces


def test_large_motions_have_small_shards():
    assert sets.motion_block(100) == 65_536 and sets.motion_block(4096) == 16_384
    assert sets.shard_size(None, 4096, block=16_384) == 16_384
    with pytest.raises(RequestError, match=r"a multiple of 16,384; for 2 objects at most 16,384"):
        sets.shard_size(65_536, 4096, 2, 16_384)


def test_what_a_set_of_motions_is(tmp_path):
    """The motions of the same request in memory; as scenes, its moments; and no set of scenes."""
    place = f"{tmp_path}/set/"
    written = scenegen.sample_to(place, SPEC, PHI, n=40, seed=1)
    assert len(written) == 40 and written.header.time.steps == 3
    made, found = scenegen.sample_motions(SPEC, PHI, n=40, seed=1), scenegen.read_motions(place)
    assert made.poses.tobytes() == found.poses.tobytes() and made.header == found.header
    assert made.facts["way"].tobytes() == found.facts["way"].tobytes()
    np.testing.assert_allclose(scenegen.read_scenes(place).poses, made.poses.reshape(-1, 2, 3), atol=1e-12)
    with pytest.raises(DataError, match=r"its shards hold motions\n.*read_motions"):
        scenegen.open_set(place)
    scenegen.sample_to(f"{tmp_path}/scenes/", scenegen.parse("leftOf(mug, plate)"), n=4)
    with pytest.raises(DataError, match="it is a set of scenes"):
        scenegen.read_motions(f"{tmp_path}/scenes/")


def test_a_shard_that_is_another_file(tmp_path):
    place = tmp_path / "set"
    scenegen.sample_to(f"{place}/", SPEC, PHI, n=20, seed=1)
    scenegen.sample_motions(SPEC, PHI, n=20, seed=2).save(place / "part-000000.parquet")
    with pytest.raises(DataError, match=r"part-000000.parquet in .* is damaged: its header is not that"):
        scenegen.read_motions(f"{place}/")
    with pytest.raises(DataError, match="is damaged"):
        scenegen.sample_to(f"{place}/", SPEC, PHI, n=20, seed=1, resume=True)
