"""Sets drawn by a cluster are those of this machine, bit by bit, whatever dies on the way."""

import hashlib
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scenegen.scenes.sets import read_manifest
from scenegen.scenes.stores import store_at

pytestmark = pytest.mark.cluster
SCENES = int(os.environ.get("CLUSTER_SCENES", "1000000"))
KILLS = int(os.environ.get("CLUSTER_KILLS", "20"))


def command(out, *more, scenes=SCENES):
    return [
        sys.executable, "-m", "scenegen", "sample", "table_setting", "--phi", "-0.1:0.1", "-n", str(scenes),
        "--shard-size", "65536", "--timeout", "3600", "--out", str(out), "-q", *more,
    ]  # fmt: skip


def digests(location):
    store = store_at(location)
    return {name: hashlib.sha256(store.read(name)).hexdigest() for name in store.sizes()}


@pytest.fixture(scope="session")
def plain(tmp_path_factory):
    """What local processes write."""
    folder = f"{tmp_path_factory.mktemp('plain')}/set/"
    subprocess.run(command(folder), check=True)
    return digests(folder)


def shards(location):
    store = store_at(location)
    return len(read_manifest(store).shards) if "manifest.json" in store.sizes() else 0


def until(condition, seconds=600):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.2)


def workers():
    """Processes of these tests' Ray that draw or write."""
    parents, drawing = {}, []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            parents[int(entry.parent.name)] = int(entry.read_text().rpartition(")")[2].split()[1])
            if (entry.parent / "cmdline").read_bytes().startswith((b"ray::draw", b"ray::choose", b"ray::write")):
                drawing.append(int(entry.parent.name))
        except OSError:
            continue

    def ours(pid):
        while pid in parents and pid != os.getpid():
            pid = parents[pid]
        return pid == os.getpid()

    return [pid for pid in drawing if ours(pid)]


def test_a_node_and_a_worker_are_killed(cluster, plain, tmp_path):
    out = f"{tmp_path}/set/"
    run = subprocess.Popen(command(out, "--engine", "ray", "--address", cluster.address))
    until(lambda: shards(out) >= 2)
    until(workers)
    os.kill(random.Random(0).choice(workers()), signal.SIGKILL)
    until(lambda: shards(out) >= 4)
    node = next(iter(cluster.worker_nodes))
    cluster.remove_node(node, allow_graceful=False)
    assert run.wait(timeout=3000) == 0
    assert digests(out) == plain


def test_the_driver_is_killed_and_resumed(cluster, plain, tmp_path):
    out = f"{tmp_path}/set/"
    run = subprocess.Popen(command(out, "--engine", "ray", "--address", cluster.address))
    until(lambda: shards(out) >= 3)
    run.kill()
    run.wait()
    done = shards(out)
    assert 3 <= done < SCENES // 65536
    subprocess.run(command(out, "--engine", "ray", "--address", cluster.address, "--resume"), check=True)
    assert digests(out) == plain


def test_begun_by_one_engine_and_ended_by_the_other(cluster, plain, tmp_path, interruptible):
    out = f"{tmp_path}/set/"
    run = subprocess.Popen(command(out, "--engine", "ray", "--address", cluster.address))
    until(lambda: shards(out) >= 2)
    run.send_signal(signal.SIGINT)
    assert run.wait(timeout=300) == 130
    subprocess.run(command(out, "--resume"), check=True)
    assert digests(out) == plain


def test_an_object_store(cluster, plain, s3):
    """Shards are written by the workers, which take the store's place and keys from the nodes' environment."""
    subprocess.run(command(f"{s3}/ray/", "--engine", "ray", "--address", cluster.address), check=True)
    assert digests(f"{s3}/ray/") == plain


@pytest.mark.slow
def test_random_kills(cluster, plain, tmp_path):
    """Nodes, workers and drivers die at random; the run is gone on with until it is done."""
    rng, out, kills = random.Random(1), f"{tmp_path}/set/", 0
    said = []
    while True:
        run = subprocess.Popen(
            command(out, "--engine", "ray", "--address", cluster.address, *(["--resume"] if shards(out) else []))
        )
        while run.poll() is None:
            try:
                run.wait(timeout=rng.uniform(1.0, 5.0))
            except subprocess.TimeoutExpired:
                if kills == KILLS:
                    continue
                kind = rng.choice(["worker", "worker", "node", "driver"])
                if kind == "worker" and workers():
                    os.kill(rng.choice(workers()), signal.SIGKILL)
                elif kind == "node":
                    cluster.remove_node(rng.choice(list(cluster.worker_nodes)), allow_graceful=False)
                    cluster.add()
                elif kind == "driver":
                    run.kill()
                else:
                    continue
                kills += 1
                said.append((kind, shards(out)))
        if run.returncode == 0 and kills >= KILLS:
            break
        if run.returncode == 0:  # it was done before all kills: once more
            assert digests(out) == plain
            subprocess.run(["rm", "-r", out], check=True)
    print(said)
    assert digests(out) == plain
