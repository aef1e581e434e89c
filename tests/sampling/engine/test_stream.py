"""Streaming to files: the same bytes whatever happens on the way, and nothing lost that was checkpointed."""

import dataclasses
import errno
import json
import os
import random
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from scenegen.errors import DataError, OutputError, RequestError
from scenegen.sampling.engine.writer import folder_of
from scenegen.scenes import sets
from scenegen.scenes.blocks import join_blocks
from scenegen.scenes.formats.registry import FORMATS, read_scenes

HERE = Path(__file__).parent
SMALL = {"checkpoint": 0.0, "size": 300}


class Runs:
    """Runs in processes of their own."""

    def __init__(self):
        self.process = subprocess.Popen(
            [sys.executable, str(HERE / "made.py")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def __call__(self, path, kill=None, **options):
        """The exit status, and how many file operations there were."""
        words = {"path": str(path), "made": {"scenes_wanted": 2000}, "kill": kill, **SMALL, **options}
        self.process.stdin.write(json.dumps(words) + "\n")
        self.process.stdin.flush()
        return json.loads(self.process.stdout.readline())


@pytest.fixture(scope="module")
def run():
    runs = Runs()
    yield runs
    runs.process.communicate(timeout=10)


@pytest.mark.parametrize("ending", FORMATS)
def test_what_is_written(ending, tmp_path, unbroken):
    (tmp_path / f"x{ending}").write_bytes(unbroken[ending])
    reading = read_scenes(tmp_path / f"x{ending}")
    scenes = reading.whole()
    assert scenes.count == 2000 and reading.labels == ("task",) and reading.header.sampler["pieces"] > 5
    np.testing.assert_array_equal(scenes.phi[0], scenes.rows[3] - scenes.rows[0])
    assert len(np.unique(scenes.rows[0])) == 2000
    spread = np.histogram(scenes.phi[0], bins=32, range=(-0.9, 0.9))[0]
    assert spread.min() >= 2000 // 32 and spread.max() <= 2000 // 32 + 1
    first = np.histogram(scenes.phi[0, :300], bins=32, range=(-0.9, 0.9))[0]
    assert first.min() >= 9 and first.max() <= 10


@pytest.mark.parametrize("workers", [2, pytest.param(5, marks=pytest.mark.slow)])
def test_workers_and_checkpoints_do_not_change_the_bytes(workers, tmp_path, unbroken):
    from made import Made, stream

    tally = stream(tmp_path / "x.parquet", Made(2000), workers=workers, size=300, checkpoint=0.0)
    assert (tmp_path / "x.parquet").read_bytes() == unbroken[".parquet"]
    assert tally.scenes == 2000
    assert [entry.name for entry in tmp_path.iterdir()] == ["x.parquet"]


def struck(run, path, moments, expected):
    """Strike a run at each moment, every third one twice, and resume it each time."""
    for number, moment in enumerate(moments):
        assert run(path, kill=moment)[0] == -signal.SIGKILL, moment
        assert len(list(path.parent.glob("*/_run/waiting-*"))) <= 2, moment
        if number % 3 == 0:
            run(path, kill=12.5, resume=True)
        assert run(path, resume=True)[0] == 0, moment
        assert path.read_bytes() == expected, moment
        assert [entry.name for entry in path.parent.iterdir()] == [path.name], moment
        path.unlink()


@pytest.mark.long
def test_killed_here_and_there(run, tmp_path, unbroken):
    """Struck before and after some of the file operations of a run, and all of the last ones: joining, tidying up."""
    status, count = run(tmp_path / "x.jsonl")
    assert status == 0 and count > 60
    (tmp_path / "x.jsonl").unlink()
    some = random.Random(7).sample([half / 2 for half in range(2, 2 * count - 16)], 5)
    struck(
        run, tmp_path / "x.jsonl", [*some, *(count + 0.5 - back / 2 for back in range(0, 16, 2))], unbroken[".jsonl"]
    )


@pytest.mark.long
def test_killed_once_all_is_done(run, tmp_path, unbroken):
    """Then nothing is done again; and a run that had to end early is gone on with, or begun anew."""
    path, folder = tmp_path / "x.jsonl", tmp_path / "x.jsonl.part"
    for pieces in (1000, 4):
        early = {"pieces": pieces, "keep_partial": True}
        _, count = run(path, **early)
        written = path.read_bytes()
        left = 0
        for back in range(8):
            path.unlink(missing_ok=True)
            run(path, kill=count + 0.5 - back / 2, **early)
            if folder.exists() and path.exists():
                left += 1
                assert path.read_bytes() == written
                manifest = folder / "manifest.json"
                done = manifest.exists() and json.loads(manifest.read_text())["complete"]
                status, operations = run(path, resume=True, **early)
                assert status == 0 and not folder.exists()
                if pieces == 1000:
                    assert path.read_bytes() == written and (operations < 30 or not done)
                else:
                    assert not done and read_scenes(path).whole().count > 600
        assert left > 2


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".jsonl", ".parquet"])
def test_killed_anywhere(ending, run, tmp_path, unbroken):
    _, count = run(tmp_path / f"x{ending}")
    (tmp_path / f"x{ending}").unlink()
    struck(run, tmp_path / f"x{ending}", [half / 2 for half in range(2, 2 * count + 2)], unbroken[ending])


@pytest.mark.long
def test_killed_at_any_time_with_workers(tmp_path, unbroken):
    """The parent dies, its workers follow, another crew takes over: first as soon as there are shards, however fast the
    machine is, then by the clock."""
    source = random.Random(3)
    path = tmp_path / "x.parquet"
    kills = 0
    while not path.exists():
        words = {"path": str(path), "made": {"scenes_wanted": 2000}, **SMALL, "resume": True, "workers": 2}
        program = f"import sys; sys.path.insert(0, {str(HERE)!r}); import made; made.run({words!r})"
        process = subprocess.Popen([sys.executable, "-c", program])
        try:
            if not kills:
                while not folder_of(path).exists() and process.poll() is None:
                    time.sleep(0.001)
                raise subprocess.TimeoutExpired("the first run", 0.0)
            # two kills by the clock at most: a slow machine would start Python again and again
            assert process.wait(timeout=source.uniform(0.5, 1.0) * (1 + kills) if kills < 3 else 300) == 0
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            kills += 1
    assert path.read_bytes() == unbroken[".parquet"]
    assert kills >= 1 and not (tmp_path / "x.parquet.part").exists()


@pytest.mark.long
def test_another_request_is_refused(run, tmp_path):
    from made import Made, stream

    path = tmp_path / "x.jsonl"
    run(path, kill=60)
    for other, said in (
        (Made(2000, seed=1), "`seed` was 0, and is 1 now"),
        (Made(2001), "`n` was 2000, and is 2001 now"),
        (Made(2000, plan_digest="other"), '`plan` was "plan", and is "other" now'),
        (Made(2000, low=-0.8), "`low` was -0.9, and is -0.8 now"),
    ):
        with pytest.raises(RequestError, match="is of another request") as caught:
            stream(path, other, resume=True, size=300)
        (problem,) = caught.value.diagnostics
        assert said in problem.title and problem.help
    with pytest.raises(RequestError, match=r"x\.jsonl\.part holds [\d,]+ scenes of an unfinished run") as caught:
        stream(path, Made(2000), size=300)
    assert "`resume`" in caught.value.diagnostics[0].help
    stream(path, Made(2000), resume=True, size=300)
    assert path.exists()


def contents(folder):
    """The files that a run goes on from."""
    files = (entry for entry in folder.rglob("*") if entry.is_file() and not entry.name.startswith("."))
    return {entry.name: entry.read_bytes() for entry in files}


@pytest.mark.parametrize(
    "what", ["shard", "bit", "swap", "pool", "pool bit", "cut", "state", "manifest", "foreign", "busy"]
)
def test_folders_that_cannot_be_resumed(what, run, tmp_path):
    from made import Made, stream

    path, folder = tmp_path / "x.jsonl", tmp_path / "x.jsonl.part"
    run(path, kill=60)
    known = (folder / "manifest.json").read_text()
    named = json.loads(known)
    first, last = (folder / named["shards"][place]["file"] for place in (0, -1))
    waiting = folder / named["checkpoint"]["waiting"]
    if what == "shard":
        first.write_bytes(first.read_bytes()[:-1])
    elif what in ("bit", "pool bit"):
        damaged = waiting if what == "pool bit" else last
        data = bytearray(damaged.read_bytes())
        data[-10] ^= 64
        damaged.write_bytes(data)
    elif what == "swap":  # the same bits, read from the other end
        first.write_bytes(first.read_bytes().replace(b"<f8", b">f8", 1))
    elif what == "state":
        pieces = named["checkpoint"]["state"]["pieces"]
        (folder / "manifest.json").write_text(known.replace(f'"pieces": {pieces}', f'"pieces": {pieces + 1}'))
    elif what == "pool":
        waiting.unlink()
    elif what == "cut":
        waiting.write_bytes(b"")
    elif what == "manifest":
        (folder / "manifest.json").write_text("{}")
    elif what == "foreign":
        (folder / "thesis.tex").write_text("")
    before = contents(folder)
    said = {"foreign": "is in the way: it holds `thesis.tex`", "busy": "another run is writing"}
    if what == "busy":
        import fcntl

        with (folder / ".lock").open("r+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX)
            with pytest.raises(OutputError, match=said[what]):
                stream(path, Made(2000), resume=True, size=300)
    else:
        with pytest.raises((DataError, OutputError), match=said.get(what, "is damaged: it cannot be resumed")):
            stream(path, Made(2000), resume=True, size=300)
    assert contents(folder) == before


def test_what_a_run_leaves_that_had_just_begun_is_replaced(run, tmp_path, unbroken):
    from made import Made, stream

    path = tmp_path / "x.jsonl"
    run(path, kill=4)
    assert (tmp_path / "x.jsonl.part").exists() and not (tmp_path / "x.jsonl.part" / "manifest.json").exists()
    stream(path, Made(2000), size=300)
    assert path.read_bytes() == unbroken[".jsonl"]


def test_resuming_nothing_just_begins(tmp_path, unbroken):
    from made import Made, stream

    stream(tmp_path / "x.jsonl", Made(2000), resume=True, size=300)
    assert (tmp_path / "x.jsonl").read_bytes() == unbroken[".jsonl"]


@pytest.mark.parametrize("partial", [False, True])
@pytest.mark.parametrize("after", [1, 4])
def test_when_time_is_up(after, partial, tmp_path, unbroken):
    from made import Made, stream

    path = tmp_path / "x.jsonl"
    calls = iter(range(1, 100))
    tally = stream(path, Made(2000), size=300, keep_partial=partial, spent=lambda: next(calls) == after)
    assert tally.pieces == after and tally.scenes < 2000 and tally.scarcest is not None
    assert path.exists() == partial
    assert (tmp_path / "x.jsonl.part").exists() != partial
    if path.exists():
        scenes = read_scenes(path).whole()
        assert scenes.count == tally.scenes > 150 * after and len(np.unique(scenes.rows[0])) == scenes.count
    else:
        stream(path, Made(2000), size=300, resume=True)
        assert path.read_bytes() == unbroken[".jsonl"]


def test_an_end_to_patience(tmp_path):
    """Pieces that bring nothing of use end a run after so many in a row; a break does not start the count anew."""
    from made import Made, stream

    class Empty(Made):
        def draw(self, k):
            made = super().draw(k)
            return made if k < 2 else dataclasses.replace(made, cell=np.full_like(made.cell, -1))

    tally = stream(tmp_path / "x.jsonl", Empty(2000, patience=7), size=300)
    assert tally.pieces == 9 and 0 < tally.scenes < 2000
    for after in (4, 7):
        calls = iter(range(1, 100))
        stream(tmp_path / f"{after}.jsonl", Empty(2000, patience=7), size=300, spent=lambda: next(calls) == after)  # noqa: B023
        again = stream(tmp_path / f"{after}.jsonl", Empty(2000, patience=7), size=300, resume=True)
        assert again == tally


def test_more_pieces_than_scenes_need(tmp_path):
    """Those that an error bar needs are run, and change no scene."""
    from made import Made, stream

    plain = stream(tmp_path / "plain.jsonl", Made(40), size=300)
    more = stream(tmp_path / "more.jsonl", Made(40, fewest=9), size=300)
    assert plain.pieces == 1 and more.pieces == 9 and more.facts[0] > 9 * 1500
    one, two = (read_scenes(tmp_path / name).whole() for name in ("plain.jsonl", "more.jsonl"))
    assert np.array_equal(one.rows, two.rows)


def test_an_interrupt_keeps_all_of_it(tmp_path, unbroken, monkeypatch):
    from made import Made, stream

    class Interrupted(Made):
        def draw(self, k):
            if k == 3:
                raise KeyboardInterrupt
            return super().draw(k)

    path = tmp_path / "x.jsonl"
    with pytest.raises(KeyboardInterrupt, match=r"keeps [0-9,]+ scenes: go on with `resume`"):
        stream(path, Interrupted(2000), size=300)
    manifest = json.loads((tmp_path / "x.jsonl.part" / "manifest.json").read_text())
    assert manifest["checkpoint"]["state"]["pieces"] == 3
    stream(path, Made(2000), size=300, resume=True)
    assert path.read_bytes() == unbroken[".jsonl"]


def test_a_block_that_does_not_pass_inspection_is_not_stored(tmp_path):
    from made import Made, stream

    blocks = []

    class Inspected(Made):
        def check(self, rows, phi):
            blocks.append(rows)
            if len(blocks) == 3:
                raise AssertionError("not asked for")

    with pytest.raises(AssertionError):
        stream(tmp_path / "x.jsonl", Inspected(2000, is_verified=True), size=300, checkpoint=0.0)
    manifest = json.loads((tmp_path / "x.jsonl.part" / "manifest.json").read_text())
    assert sum(shard["scenes"] for shard in manifest["shards"]) == 600


@pytest.mark.long
def test_blocks_in_memory_are_the_blocks_of_the_file(tmp_path, unbroken):
    from made import Made

    from scenegen.sampling.engine.blocks import run_blocks

    (tmp_path / "x.parquet").write_bytes(unbroken[".parquet"])
    written = read_scenes(tmp_path / "x.parquet").whole()
    for workers in (1, 2):
        blocks = list(run_blocks(Made(2000), 1, size=300, workers=workers))
        assert [block.count for block in blocks] == [300] * 6 + [200]
        together = join_blocks(blocks, 6, 1)
        assert np.array_equal(together.rows, written.rows) and np.array_equal(together.phi, written.phi)


def test_disk_full(tmp_path, monkeypatch, unbroken):
    from made import Made, stream

    path = tmp_path / "x.jsonl"
    save, calls = sets.HashingWriter.write, []

    def full(*args):
        calls.append(1)
        if len(calls) == 6:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return save(*args)

    with monkeypatch.context() as patch:
        patch.setattr(sets.HashingWriter, "write", full)
        with pytest.raises(OutputError, match="no space left") as caught:
            stream(path, Made(2000), **SMALL)
    assert "`resume`" in caught.value.diagnostics[0].help
    stream(path, Made(2000), resume=True, size=300)
    assert path.read_bytes() == unbroken[".jsonl"]


def steps(path, *, resume=False, limits=(1 << 40,) * 3):
    """Two shards with a checkpoint each, then the file; in each step no file may grow beyond a limit of its own."""
    from made import Made, header_of, stream

    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    limit = lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))  # noqa: E731
    made = Made(4000, size=2500, spread="base", low=-0.95)

    def spent():
        limit(limits[1])
        return False

    def header(tally):
        if tally.scenes == 4000:
            limit(limits[2])
        return header_of(made)

    limit(limits[0])
    try:
        stream(path, made, size=2000, checkpoint=0.0, resume=resume, spent=spent, header=header)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("ending", [".parquet", ".jsonl"])
@pytest.mark.parametrize("when", ["first shard", "second shard", "joining"])
def test_said_and_kept(when, ending, tmp_path):
    path = tmp_path / f"x{ending}"
    place = ("first shard", "second shard", "joining").index(when)
    with pytest.raises(OutputError) as caught:
        steps(path, limits=[*[1 << 40] * place, 50_000, 1 << 40, 1 << 40])
    (problem,) = caught.value.diagnostics
    assert problem.title == f"cannot write {path}: file too large"
    assert "requested and" not in str(caught.value)
    folder = folder_of(path)
    if place == 0:
        assert "nothing was left behind" in problem.help and not list(tmp_path.iterdir())
        return
    assert problem.help.startswith(f"the disk is full; {folder} keeps {2000 * place:,} scenes: ")
    assert folder.is_dir() and not path.exists()
    steps(path, resume=True)
    steps(tmp_path / f"y{ending}")
    assert path.read_bytes() == (tmp_path / f"y{ending}").read_bytes() and not folder.exists()


def test_a_run_of_an_earlier_version_is_refused(tmp_path):
    from made import Made, stream

    folder = tmp_path / "x.jsonl.part"
    folder.mkdir()
    known = {"format": "scenegen/shards", "version": 2, "shards": [{"file": "shard-000000.npy", "scenes": 600}]}
    (folder / "manifest.json").write_text(json.dumps(known))
    for name in ("shard-000000.npy", "pool-000001.npy", "lock"):
        (folder / name).write_bytes(b"")
    before = contents(folder)
    for resume in (False, True):
        with pytest.raises(RequestError, match="holds 600 scenes of an unfinished run") as caught:
            stream(tmp_path / "x.jsonl", Made(2000), size=300, resume=resume)
        assert "an earlier version of scenegen wrote it" in caught.value.diagnostics[0].help
    assert contents(folder) == before


PEAK = """
import resource, sys
sys.path.insert(0, sys.argv[1])
from made import Made, stream
made = Made(int(sys.argv[3]), objects=4, size=100_000, spread="base", low=-0.95)
stream(sys.argv[2], made, workers=int(sys.argv[4]))
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)
"""


def peak(path, count, workers=1):
    """MB of memory at most while `count` scenes of 12 coordinates go to a file."""
    words = [sys.executable, "-c", PEAK, str(HERE), str(path), str(count), str(workers)]
    began = time.monotonic()
    size = float(subprocess.run(words, capture_output=True, text=True, check=True, timeout=600).stdout)
    print(f"{count:,} scenes, {workers} workers: {size:.0f} MB, {time.monotonic() - began:.1f} s")
    return size


@pytest.mark.slow
def test_memory_is_flat(tmp_path):
    few = peak(tmp_path / "few.parquet", 500_000)
    many = peak(tmp_path / "many.parquet", 2_000_000)
    assert many < few + 50  # the scenes more are 156 MB


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
def test_memory_is_flat_for_ten_million(workers, tmp_path):
    few = peak(tmp_path / "few.parquet", 3_000_000, workers)
    many = peak(tmp_path / "many.parquet", 10_000_000, workers)
    (tmp_path / "many.parquet").unlink()
    assert many < few + 80  # the scenes more are 728 MB; up to 64 MB wait for the thread that packs
