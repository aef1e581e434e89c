"""Sets of shards: the same bytes from each engine, whatever happens on the way."""

import functools
import hashlib
import itertools
import shutil
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from scenegen.errors import DataError, OutputError, RequestError
from scenegen.sampling.engine.engines import BlockPacker, Local, choose_scenes, open_engine
from scenegen.scenes.blocks import Block
from scenegen.scenes.formats.registry import read_scenes, write_scenes
from scenegen.scenes.sets import SET_MANIFEST, read_manifest, read_set
from scenegen.scenes.stores import store_at

sys.path.insert(0, str(Path(__file__).parent))
from made import Made
from made_sets import BLOCK, COUNT, SHARD, digest, run


class Elsewhere(Local):
    """Holds scenes under a number, as a cluster does, and completes shards later than they were begun."""

    def __init__(self, late=1):
        super().__init__(1)
        self.kept, self.late, self.begun, self.most = {}, late, [], 0

    def pieces(self, drawing, first):
        for drawn in super().pieces(drawing, first):
            yield self.hold(drawn[0]), *drawn[1:]

    def choose(self, which, parts):
        return self.hold(choose_scenes(which, {number: self.kept[held] for number, held in parts.items()}))

    def fetch(self, scenes):
        return self.kept[scenes]

    def hold(self, scenes):
        self.kept[len(self.kept)] = scenes
        return len(self.kept) - 1

    def write(self, writing, number, pieces, blocks):
        self.begun.append((writing, number, pieces, [self.kept[one] for one in blocks]))

    def finished_shards(self, *, wait):
        ready = self.begun if wait else self.begun[: max(0, len(self.begun) - self.late)]
        self.begun = self.begun[len(ready) :]
        yield from (writing(number, pieces, blocks) for writing, number, pieces, blocks in ready)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    """A set that nothing disturbed."""
    folder = tmp_path_factory.mktemp("plain") / "set"
    run(folder)
    return folder


def test_what_is_in_a_set(plain, tmp_path):
    from made import Made, stream

    manifest = read_manifest(store_at(str(plain)))
    assert manifest.complete and manifest.checkpoint is None and manifest.sampler["pieces"] > 5
    assert [shard.scenes for shard in manifest.shards] == [600, 600, 600, 200]
    stream(tmp_path / "x.parquet", Made(COUNT), size=BLOCK)
    file = read_scenes(tmp_path / "x.parquet").whole()
    scenes = read_set(store_at(str(plain))).whole()
    np.testing.assert_array_equal(scenes.rows, file.rows)
    np.testing.assert_array_equal(scenes.phi, file.phi)
    phi = manifest.phi()["task"]
    assert (phi.lowest, phi.highest) == (file.phi.min(), file.phi.max())
    assert phi.mean == pytest.approx(file.phi.mean())
    for shard in manifest.shards:
        assert hashlib.sha256((plain / shard.file).read_bytes()).hexdigest() == shard.sha256
        assert (plain / shard.file).stat().st_size == shard.bytes


@pytest.mark.long
@pytest.mark.parametrize("engine", [lambda: Local(2), lambda: Elsewhere(1), lambda: Elsewhere(3)])
def test_engines_give_the_same_bytes(engine, plain, tmp_path):
    run(tmp_path / "set", engine())
    assert digest(tmp_path / "set") == digest(plain)


class Struck(Exception):  # noqa: N818 - stands for kill -9
    pass


class Fragile:
    """A store whose process dies before, or after, its n-th change."""

    def __init__(self, store, moment):
        self.store, self.moment, self.count = store, moment, 0

    def __getattr__(self, name):
        return getattr(self.store, name)

    def _change(self, call, *words):
        self.count += 1
        if self.count == self.moment:
            raise Struck
        call(*words)
        if self.count + 0.5 == self.moment:
            raise Struck

    def write(self, name, *parts):
        self._change(self.store.write, name, *parts)

    def delete(self, *names):
        self._change(self.store.delete, *names)


@pytest.mark.long
@pytest.mark.parametrize("engine", [lambda: Local(1), lambda: Elsewhere(2)])
def test_killed_anywhere_and_resumed(engine, plain, tmp_path):
    whole = Fragile(store_at(f"{tmp_path}/whole/"), None)
    run(None, engine(), whole)
    assert whole.count > 12
    for half in range(2, 2 * whole.count + 2):
        folder = tmp_path / f"{half}"
        with pytest.raises(Struck):
            run(None, engine(), Fragile(store_at(f"{folder}/"), half / 2))
        _, manifest = run(None, engine(), store_at(f"{folder}/"), resume=True)
        assert manifest.complete and digest(folder) == digest(plain), half / 2


@pytest.mark.parametrize("engine", [lambda: Local(1), lambda: Elsewhere(2)])
def test_a_run_of_which_nothing_waits_is_gone_on_with(engine, tmp_path):
    """The first piece completes a shard, so there is no file of scenes that wait."""
    made = {"spread": "base", "size": SHARD + 100}
    run(tmp_path / "whole", engine(), made=made)
    pieces = itertools.count()
    _, found = run(tmp_path / "set", engine(), made=made, spent=lambda: next(pieces) == 0)
    assert found.shards and found.checkpoint is not None and found.checkpoint.waiting is None
    _, found = run(tmp_path / "set", engine(), made=made, resume=True)
    assert found.complete and digest(tmp_path / "set") == digest(tmp_path / "whole")


def test_time_is_up(plain, tmp_path):
    """What is complete is kept, and gone on with; or it is all there will be, with `keep_partial`."""
    asked = iter([False, False, True])
    _, manifest = run(tmp_path / "set", spent=lambda: next(asked))
    assert not manifest.complete and 0 < manifest.scenes < COUNT
    with pytest.raises(RequestError, match="of an unfinished run"):
        run(tmp_path / "set")
    with pytest.raises(RequestError, match="`n` was 2000, and is 2500 now"):
        run(tmp_path / "set", wanted=2500, resume=True)
    run(tmp_path / "set", resume=True)
    assert digest(tmp_path / "set") == digest(plain)
    asked = iter([False, False, True])
    tally, manifest = run(tmp_path / "part", spent=lambda: next(asked), keep_partial=True)
    assert manifest.complete and manifest.scenes == tally.found < COUNT
    assert read_set(store_at(f"{tmp_path}/part/")).whole().count == tally.found


def test_places_that_are_taken(plain, tmp_path):
    with pytest.raises(RequestError, match="has a set of scenes already"):
        run(plain)
    (tmp_path / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match=r"has other files: notes\.txt"):
        run(tmp_path)
    with pytest.raises(DataError, match="is not a set of scenes"):
        read_manifest(store_at(str(tmp_path)))


def test_what_is_not_part_of_the_set_is_removed(plain, tmp_path):
    """A shard that a killed run wrote and never named would be read by whoever reads the folder."""
    store = Fragile(store_at(f"{tmp_path}/set/"), 6.5)
    with pytest.raises(Struck):
        run(None, Elsewhere(3), store)
    (tmp_path / "set" / "part-000009.parquet").write_bytes(b"left by a run of more shards")
    run(tmp_path / "set", resume=True)
    assert digest(tmp_path / "set") == digest(plain) and not (tmp_path / "set" / "_run").exists()


def test_a_run_without_a_shard_is_begun_anew(plain, tmp_path):
    """Even with `resume`, and whatever its request was: its manifest must not become that of this one."""
    with pytest.raises(Struck):
        run(None, None, Fragile(store_at(f"{tmp_path}/set/"), 4), wanted=900)
    assert read_manifest(store_at(f"{tmp_path}/set/")).shards == []
    run(tmp_path / "set", resume=True)
    assert digest(tmp_path / "set") == digest(plain)


def test_a_complete_set_is_left_as_it_is(plain):
    before = digest(plain)
    tally, manifest = run(plain, resume=True)
    assert tally is None and manifest.complete and digest(plain) == before


def test_damage_is_found(plain, tmp_path):
    asked = iter([False, False, False, True])
    _, manifest = run(tmp_path, spent=lambda: next(asked))
    shard = tmp_path / manifest.shards[0].file
    shard.write_bytes(shard.read_bytes()[:-9])
    with pytest.raises(DataError, match="its size is not that of the manifest"):
        run(tmp_path, resume=True)
    shard.unlink()
    with pytest.raises(DataError, match="it is missing"):
        run(tmp_path, resume=True)
    (tmp_path / SET_MANIFEST).write_text("{}")
    with pytest.raises(DataError, match="is not a set of scenes"):
        run(tmp_path, resume=True)


@pytest.mark.parametrize("place", [0.02, 0.5, 0.98])
def test_a_bit_of_a_complete_shard_is_never_believed(place, plain, tmp_path):
    """Of a set that is not yet complete, and of one that is: the manifest has the checksum."""
    asked = iter([False, False, False, True])
    run(tmp_path / "part", spent=lambda: next(asked))
    shutil.copytree(plain, tmp_path / "whole")
    for folder in (tmp_path / "part", tmp_path / "whole"):
        shard = folder / "part-000000.parquet"
        data = bytearray(shard.read_bytes())
        data[int(place * len(data))] ^= 1
        shard.write_bytes(data)
        with pytest.raises(DataError, match=r"part-000000\.parquet in .* is damaged: its checksum is not that"):
            run(folder, resume=True)


@pytest.mark.parametrize("what", ["waiting", "state"])
def test_a_bit_of_an_unfinished_run_is_never_believed(what, tmp_path):
    asked = iter([False, False, False, True])
    _, manifest = run(tmp_path, spent=lambda: next(asked))
    assert manifest.checkpoint is not None and manifest.checkpoint.waiting is not None
    if what == "waiting":
        path = tmp_path / manifest.checkpoint.waiting
        data = bytearray(path.read_bytes())
        data[-10] ^= 64
        path.write_bytes(data)
    else:
        idle = manifest.checkpoint.state["pieces"]
        text = (tmp_path / SET_MANIFEST).read_text()
        changed = text.replace(f'"pieces": {idle},\n   "idle"', f'"pieces": {idle + 1},\n   "idle"')
        assert changed != text
        (tmp_path / SET_MANIFEST).write_text(changed)
    with pytest.raises(DataError, match="what an unfinished run has to go on from has another checksum"):
        run(tmp_path, resume=True)


def test_a_run_does_not_go_on_from_a_shard_that_is_another(tmp_path):
    import json

    asked = iter([False, False, False, True])
    _, manifest = run(tmp_path, spent=lambda: next(asked))
    scenes = read_scenes(tmp_path / manifest.shards[0].file).whole()
    other = Block(scenes.rows, scenes.phi[:, ::-1] * 0.5)
    header = read_scenes(tmp_path / manifest.shards[0].file).header
    write_scenes(tmp_path / "part-000000.parquet", header, manifest.labels, [other])
    said = json.loads((tmp_path / SET_MANIFEST).read_text())
    said["shards"][0]["bytes"] = (tmp_path / "part-000000.parquet").stat().st_size
    (tmp_path / SET_MANIFEST).write_text(json.dumps(said))
    with pytest.raises(DataError, match=r"part-000000\.parquet in .* is damaged: its checksum"):
        run(tmp_path, resume=True)


def test_chosen_scenes():
    parts = {
        7: Block(np.arange(8.0).reshape(2, 4), np.arange(4.0)[None]),
        -1: Block(-np.ones((2, 2)), -np.ones((1, 2))),
    }
    block = choose_scenes(np.array([[7.0, -1.0, 7.0], [3.0, 1.0, 0.0]]), parts)
    np.testing.assert_array_equal(block.rows, [[3.0, -1.0, 0.0], [7.0, -1.0, 4.0]])
    np.testing.assert_array_equal(block.phi, [[3.0, -1.0, 0.0]])


def test_engines_that_are_not_there(monkeypatch):
    import sys

    with pytest.raises(RequestError, match="there is no engine `rey`"):
        open_engine("rey", None, None)
    with pytest.raises(RequestError, match="that of a Ray cluster"):
        open_engine("local", None, None, "10.0.0.1:6379")
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(RequestError, match=r"ray is needed .* and is not installed"):
        open_engine("ray", None, None)


class _Slow:
    """A plan's check that fails at one block, or is slow."""

    def __init__(self, at, seconds=0.0):
        self.at, self.seconds, self.seen = at, seconds, 0

    def __call__(self, rows, phi):
        self.seen += 1
        time.sleep(self.seconds)
        assert self.seen != self.at, "a wrong scene"


def _checked(monkeypatch, check):
    monkeypatch.setattr("made_sets.Made", functools.partial(Made, is_verified=True))
    monkeypatch.setattr(Made, "check", staticmethod(check), raising=False)


@pytest.mark.long
@pytest.mark.parametrize("at", [1, 2, 3, 7])
def test_a_shard_that_cannot_be_packed_ends_the_run(at, tmp_path, monkeypatch):
    """Also when more of its blocks come than may wait: nobody waits for a thread that has ended."""
    _checked(monkeypatch, _Slow(at))
    with Local(2) as engine, pytest.raises(AssertionError, match="a wrong scene"):
        run(tmp_path / "set", engine)
    assert len(read_manifest(store_at(f"{tmp_path}/set/")).shards) <= (at - 1) // 2


@pytest.mark.long
def test_a_run_that_ends_in_the_midst_of_a_shard_leaves_no_thread(tmp_path, monkeypatch):
    _checked(monkeypatch, _Slow(0, 0.2))
    pieces = itertools.count()
    begun = time.monotonic()
    with Local(2) as engine:
        run(tmp_path / "set", engine, spent=lambda: next(pieces) == 3)
        threads = list(engine._threads._threads)
    assert time.monotonic() - begun < 30.0 and not any(thread.is_alive() for thread in threads)
    run(tmp_path / "set", Local(1), resume=True)
    assert read_manifest(store_at(f"{tmp_path}/set/")).complete


@pytest.mark.long
def test_blocks_wait_for_the_thread_that_packs_them(tmp_path, monkeypatch):
    slow = _Slow(0, 0.05)
    _checked(monkeypatch, slow)
    add, most = BlockPacker.add, []

    def counted(self, block):
        add(self, block)
        most.append(self._blocks.qsize())

    monkeypatch.setattr(BlockPacker, "add", counted)
    with Local(2) as engine:
        run(tmp_path / "set", engine)
    assert max(most) <= 1 and slow.seen == 7


@pytest.mark.parametrize("at", [1, 2])
def test_a_packing_that_fails_ends_what_waits_for_it(at):
    block, seen = Block(np.zeros((3, 5)), np.zeros((1, 5))), []

    def failing(blocks):
        for one in blocks:
            seen.append(one)
            if len(seen) == at:
                raise OSError("no room on the disk")

    with ThreadPoolExecutor(1) as threads:
        first = BlockPacker(threads, failing)
        with pytest.raises(OSError, match="on the disk"):
            for _ in range(100):
                first.add(block)
        first.finish()
        with pytest.raises(OSError, match="on the disk"):
            first.result()
        second = BlockPacker(threads, list)
        for _ in range(3):
            second.add(block)
        second.finish()
        assert len(second.result()) == 3
