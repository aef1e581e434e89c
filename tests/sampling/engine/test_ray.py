"""The engine of a cluster without one: tasks run at once, and what they get and give is pickled, read-only, as in Ray's
object store. Tests of Ray itself are in tests/cluster."""

import itertools
import os
import pickle
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from scenegen.sampling.engine import ray as ray_engine
from scenegen.sampling.engine.engines import choose_scenes
from scenegen.sampling.plan import Piece
from scenegen.scenes.blocks import Block
from scenegen.search.effort import StoppedError

sys.path.insert(0, str(Path(__file__).parent))
from made_sets import digest, run


class Reference:
    """To a stored value."""

    def __init__(self, value):
        buffers = []
        self.data = pickle.dumps(value, protocol=5, buffer_callback=lambda one: buffers.append(bytes(one.raw())))
        self.buffers = buffers

    def value(self):
        return pickle.loads(self.data, buffers=self.buffers)  # noqa: S301 - our own


class Store:
    """What the engine uses of Ray. `done` are the names of tasks and what they got, in order."""

    def __init__(self):
        self.done = []

    def cluster_resources(self):
        return {"CPU": 2.0}

    def put(self, value):
        return Reference(value)

    def get(self, reference):
        return reference.value()

    def wait(self, references, timeout=None):
        return references, []

    def cancel(self, reference, force):
        pass

    def remote(self, **_):
        def task(function, num_returns=1):
            def call(*words):
                words = [one.value() if isinstance(one, Reference) else Reference(one).value() for one in words]
                self.done.append((function.__name__, words))
                made = function(*words)
                return [Reference(one) for one in made] if num_returns > 1 else Reference(made)

            return SimpleNamespace(remote=call, options=lambda num_returns: task(function, num_returns))

        return task


@pytest.fixture
def store(monkeypatch):
    monkeypatch.setattr(ray_engine, "result_of", lambda ray, reference, what: ray.get(reference))
    return Store()


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plain") / "set"
    run(folder)
    return digest(folder)


@pytest.mark.parametrize(("spare", "early"), [(0.0, [True] * 7), (100.0, [False] * 7)])
def test_the_bytes_do_not_depend_on_who_chooses_the_scenes(spare, early, plain, store, tmp_path, monkeypatch):
    monkeypatch.setattr(ray_engine, "MAX_WHOLE_CANDIDATES", spare)
    run(tmp_path / "set", ray_engine.Cluster(store, 2, lambda: None))
    assert digest(tmp_path / "set") == plain
    writers = [words for name, words in store.done if name == "write"]
    assert [pick is None for _, _, _, picks, *_ in writers for pick in picks] == early


@pytest.mark.parametrize("seconds", [0.0, 0.1, 10.0])
def test_quick_pieces_share_a_task(seconds, plain, store, tmp_path, monkeypatch):
    monkeypatch.setattr(ray_engine, "TASK_SECONDS", seconds)
    run(tmp_path / "set", ray_engine.Cluster(store, 2, lambda: None))
    assert digest(tmp_path / "set") == plain
    counts = [words[2] for name, words in store.done if name == "draw"]
    assert max(counts) == (1 if seconds == 0.0 else ray_engine.MAX_TASK_PIECES)
    firsts = [words[1] for name, words in store.done if name == "draw"]
    assert firsts == [0, *itertools.accumulate(counts[:-1])]


def test_time_that_is_up_in_the_midst_of_a_task(monkeypatch):
    class Job:
        def __call__(self, k):
            if k == 7:
                raise StoppedError("so far")
            return Piece(np.zeros((3, k)), np.zeros((1, k)), np.zeros(k, dtype=np.int8), np.ones(1))

    monkeypatch.setattr(ray_engine, "_job", lambda _: Job())
    made = ray_engine.draw(ray_engine.pack_job("anything"), 5, 4)
    assert [one.count for one in made[1:4:2]] == [5, 6] and made[5] is made[7] is None
    assert [str(one) for one in made[4::2]] == ["so far"] * 2


def test_a_shard_of_blocks_of_both_kinds(plain, store, tmp_path, monkeypatch):
    turns = itertools.cycle([0.0, 100.0])
    pick = ray_engine.Cluster.pick

    def either(self, which, parts):
        monkeypatch.setattr(ray_engine, "MAX_WHOLE_CANDIDATES", next(turns))
        return pick(self, which, parts)

    monkeypatch.setattr(ray_engine.Cluster, "pick", either)
    run(tmp_path / "set", ray_engine.Cluster(store, 2, lambda: None))
    assert digest(tmp_path / "set") == plain


def test_pieces_stay_whole_only_where_most_candidates_become_scenes(store):
    engine = ray_engine.Cluster(store, 2, lambda: None)
    rng = np.random.default_rng(0)
    parts = {k: Block(rng.random((6, 40)), rng.random((1, 40))) for k in (-1, 3)}
    held = {k: engine.hold(block) for k, block in parts.items()}
    which = np.stack([np.repeat([3.0, -1.0], 30), np.tile(np.arange(30.0), 2)])
    engine._candidates = 80
    picked = engine.pick(which, held)
    assert store.done == [] and isinstance(picked, ray_engine._Picked)
    engine._candidates = 300
    early = engine.pick(which, held)
    assert [name for name, _ in store.done] == ["choose"]
    assert engine.fetch(early).rows.tobytes() == choose_scenes(which, parts).rows.tobytes()


def test_a_writer_takes_blocks_that_were_chosen_and_parts_to_choose_from():
    got = {}

    class Writing:
        store = SimpleNamespace(with_progress=lambda tell: tell("a line"))

        def __call__(self, number, pieces, blocks):
            got["blocks"] = blocks
            return number, pieces

    sent = ray_engine.pack_job("anything")
    rng = np.random.default_rng(0)
    first, second, whole = (Block(rng.random((6, 9)), rng.random((1, 9))) for _ in range(3))
    which = np.array([[7.0, 5.0, 7.0], [0.0, 8.0, 3.0]])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ray_engine, "_job", lambda _: Writing())
        patch.setattr(ray_engine, "replace", lambda job, store: job)
        made = ray_engine.write(sent, 4, 11, [None, which], [5, 7], first, second, whole)
    assert made == ((4, 11), ["a line"])
    assert got["blocks"][0] is whole
    np.testing.assert_array_equal(
        got["blocks"][1].rows, np.stack([second.rows[:, 0], first.rows[:, 8], second.rows[:, 3]], axis=1)
    )


def test_a_job_is_read_once_however_often_it_is_sent():
    sent = ray_engine.pack_job(("plan", 1))
    again = pickle.loads(pickle.dumps(sent))  # noqa: S301 - our own
    assert ray_engine._job(sent) is ray_engine._job(again)
    others = [ray_engine.pack_job(("plan", k)) for k in range(3)]
    assert [ray_engine._job(one) for one in others] == [("plan", 0), ("plan", 1), ("plan", 2)]
    for one, other in itertools.combinations([sent, *others], 2):
        assert one != other


def test_what_workers_on_this_machine_inherit(monkeypatch):
    monkeypatch.setenv("PYTHONPATH", "before")
    monkeypatch.delenv(ray_engine.NICENESS, raising=False)
    with ray_engine._for_children():
        assert os.environ["PYTHONPATH"].split(os.pathsep) == [entry for entry in sys.path if entry]
        assert os.environ[ray_engine.NICENESS] == "0"
    assert os.environ["PYTHONPATH"] == "before" and ray_engine.NICENESS not in os.environ
    monkeypatch.setenv(ray_engine.NICENESS, "7")
    monkeypatch.delenv("PYTHONPATH")
    with ray_engine._for_children():
        assert os.environ[ray_engine.NICENESS] == "7"
    assert os.environ[ray_engine.NICENESS] == "7" and "PYTHONPATH" not in os.environ
