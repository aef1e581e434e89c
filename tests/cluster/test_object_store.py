"""Sets in an object store, from end to end: written, gone on with, read, merged, split, filtered, streamed."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import scenegen
from scenegen.scenes.sets import read_manifest
from scenegen.scenes.stores import store_at

pytestmark = pytest.mark.cluster
SHARD = 65_536
SCENES = 3 * SHARD + 1000


def scenegen_(*words, check=True):
    done = subprocess.run(
        [sys.executable, "-m", "scenegen", *map(str, words)], capture_output=True, text=True, check=False, timeout=600
    )
    assert done.returncode == 0 or not check, done.stderr
    assert "Traceback" not in done.stderr
    return done


def sample(out, *more, n=SCENES):
    return [
        "sample", "table_setting", "--phi", "-0.1:0.1", "-n", n, "--shard-size", SHARD, "--workers", 1,
        "--timeout", 600, "--out", out, *more,
    ]  # fmt: skip


def files(location):
    store = store_at(location)
    return {name: store.read(name) for name in store.sizes()}


def shards(location):
    store = store_at(location)
    return len(read_manifest(store).shards) if "manifest.json" in store.sizes() else 0


def until(condition, seconds=600):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.1)


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    folder = f"{tmp_path_factory.mktemp('plain')}/set/"
    scenegen_(*sample(folder))
    return files(folder)


def test_written_and_read(s3, plain, tmp_path):
    url = f"{s3}/whole/"
    said = scenegen_(*sample(url))
    assert "in s3://sets/whole/" in said.stderr and files(url) == plain
    assert "has a set of scenes already" in scenegen_(*sample(url), check=False).stderr
    scenegen_(*sample(url, "--resume"))
    assert files(url) == plain
    (tmp_path / "set").mkdir()
    for name, data in plain.items():
        (tmp_path / "set" / name).write_bytes(data)
    assert scenegen_("eval", "table_setting", url).stdout == scenegen_("eval", "table_setting", tmp_path / "set").stdout
    scenes = scenegen.read_scenes(url)
    assert len(scenes) == SCENES
    report = scenegen_("data", url, "--verify", "--timeout", 0).stdout
    assert f"{SCENES:,} in 4 shards" in report and "4 of 4 shards, by checksums" in report
    stored = scenegen.open_set(url)
    rows = [phi for _, phi in stored.batches(5000, shuffle=True, seed=1)]
    assert sorted(np.concatenate(rows)[:, 0]) == sorted(scenes.phi["task"])
    poses, phi = next(iter(stored.stream(batch=64, seed=0)))
    assert poses.shape[0] == phi.shape[0] == 64


def test_edits(s3, plain):
    url = f"{s3}/edited/"
    scenegen_(*sample(f"{url}whole/"))
    scenegen_("data", "split", f"{url}whole/", "--share", "a=0.5", "--share", "b=0.5", "--out", f"{url}parts/")
    a, b = scenegen.open_set(f"{url}parts/a/"), scenegen.open_set(f"{url}parts/b/")
    assert len(a) + len(b) == SCENES and len(a) > SCENES // 3
    scenegen_("data", "merge", f"{url}parts/a/", f"{url}parts/b/", "--out", f"{url}merged/")
    merged = scenegen.read_scenes(f"{url}merged/").phi["task"]
    whole = scenegen.read_scenes(f"{url}whole/").phi["task"]
    np.testing.assert_array_equal(np.sort(merged), np.sort(whole))
    scenegen_("data", "filter", f"{url}whole/", "--phi", "0:", "--out", f"{url}kept/")
    assert len(scenegen.open_set(f"{url}kept/")) == (whole >= 0).sum()


def test_a_url_with_a_query(server, plain):
    """The place of the server can be in the URL, also where folders are made in it."""
    query = f"?endpoint_override={server[0].removeprefix('http://')}&scheme=http"
    scenegen_("sample", "table_setting", "sushi_plate", "-n", 100, "--out", f"s3://sets/several{query}")
    for name in ("table_setting", "sushi_plate"):
        assert len(scenegen.open_set(f"s3://sets/several/{name}/{query}")) == 100
    scenegen_(
        "data", "split", f"s3://sets/several/table_setting/{query}", "--share", "a=0.5", "--out",
        f"s3://sets/split/{query}",
    )  # fmt: skip
    assert 0 < len(scenegen.open_set(f"s3://sets/split/a{query}")) < 100
    assert "s3://sets/nothing/ is not a set" in scenegen_("data", f"s3://sets/nothing/{query}", check=False).stderr


def test_killed_and_gone_on_with(s3, plain):
    url = f"{s3}/killed/"
    run = subprocess.Popen([sys.executable, "-m", "scenegen", *map(str, sample(url, "-q"))])
    until(lambda: shards(url) >= 1)
    run.send_signal(signal.SIGKILL)
    run.wait()
    assert 1 <= shards(url) < 4
    scenegen_(*sample(url, "--resume"))
    assert files(url) == plain


def test_away_for_ten_seconds(s3, server, plain):
    url = f"{s3}/away/"
    server[1].write_text("503 * part-000001\n")
    run = subprocess.Popen(
        [sys.executable, "-m", "scenegen", *map(str, sample(url))], stderr=subprocess.PIPE, text=True
    )
    until(lambda: server[1].with_suffix(".seen").exists())
    time.sleep(10)
    server[1].unlink()
    said = run.communicate(timeout=300)[1]
    assert run.returncode == 0, said
    assert "part-000001.parquet in s3://sets/away/: the store is unavailable; trying again for up to 60 s" in said
    assert files(url) == plain


@pytest.mark.parametrize(("status", "said"), [(403, "access denied"), (0, "the store does not answer")])
def test_a_store_that_dies(status, said, s3, server, plain):
    url = f"{s3}/dead{status}/"
    server[1].write_text(f"{status} * part-000001\n")
    died = scenegen_(*sample(url, "-q"), check=False)
    assert died.returncode == 1
    assert f"cannot write part-000001.parquet in {url}: {said}" in died.stderr
    server[1].unlink()
    assert shards(url) == 1
    scenegen_(*sample(url, "--resume"))
    assert files(url) == plain


def test_busy_while_it_is_read(s3, server, plain):
    """A store that is away for a while is not damage."""
    url = f"{s3}/read/"
    scenegen_(*sample(url, n=SHARD))
    stored = scenegen.open_set(url)
    batches = iter(stored.batches(1000))
    server[1].write_text("503 GET part-\n")
    reader = subprocess.Popen(["sh", "-c", f"sleep 5; rm {server[1]}"])
    assert sum(len(phi) for _, phi in batches) == SHARD
    reader.wait()


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="mounts a small disk: needs root")
def test_a_full_disk(tmp_path, plain):
    size = len(plain["part-000000.parquet"]) * 27 // 10  # a shard, what waits, and a part of the next
    done = subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", tmp_path], check=False)
    if done.returncode:
        pytest.skip("may not mount here")
    try:
        full = scenegen_(*sample(f"{tmp_path}/set/", "-q"), check=False)
        assert full.returncode == 1 and "no space left on device" in full.stderr and "make room" in full.stderr
        assert full.stderr.count("error[") == 1
        before = shards(f"{tmp_path}/set/")
        assert before >= 1
        subprocess.run(["mount", "-o", f"remount,size={8 * size}", tmp_path], check=True)
        scenegen_(*sample(f"{tmp_path}/set/", "--resume"))
        assert files(f"{tmp_path}/set/") == plain
    finally:
        subprocess.run(["umount", tmp_path], check=True)
