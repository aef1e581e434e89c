"""kill -9, then --resume: the same bytes as a run that nothing disturbed."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scenegen.api.reading import read_scenes

pytestmark = pytest.mark.usefixtures("interruptible")

COUNT = "300000"  # twenty blocks: enough to be broken off twice
WORDS = ["sample", "two.spec", "--phi", "task=-0.4:0.4", "--phi", "safe=0:", "--seed", "8"]


def started(words, cwd):
    # a group of its own: its workers are ended by the end of their pipes, as they must be
    command = [sys.executable, "-m", "scenegen", *map(str, words)]
    return subprocess.Popen(command, cwd=cwd, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def shards(folder):
    return len(list(folder.glob("shard-*.npy"))) if folder.exists() else 0


def until(condition, process, seconds=60):
    deadline = time.monotonic() + seconds
    while not condition() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)


def children(pid):
    tasks = Path(f"/proc/{pid}/task")
    return {int(one) for task in tasks.iterdir() for one in (task / "children").read_text().split()}


@pytest.mark.long
def test_killed_in_the_midst_of_resuming(here, scenegen):
    """An interrupt leaves a checkpoint; the run that goes on from there is killed; the third completes the file."""
    words = [*WORDS, "-n", COUNT, "--workers", "2", "--out", "o.parquet"]
    part = here / "o.parquet.part"
    first = started(words, here)
    until(lambda: part.exists() and list(part.glob("shard-*")), first)
    first.send_signal(signal.SIGINT)
    assert "go on with --resume" in first.communicate(timeout=60)[1] and first.returncode == 130
    before = shards(part)
    assert before >= 1
    second = started([*words, "--resume"], here)
    until(lambda: list(part.glob("*.new")), second)
    workers = children(second.pid)
    second.kill()
    second.wait()
    assert second.returncode == -signal.SIGKILL and workers and shards(part) >= before
    assert scenegen(*words, "--resume").status == 0 and not part.exists()
    assert scenegen(*WORDS, "-n", COUNT, "--workers", "1", "--out", "whole.parquet").status == 0
    assert (here / "o.parquet").read_bytes() == (here / "whole.parquet").read_bytes()
    deadline = time.monotonic() + 20
    while any(Path(f"/proc/{pid}").exists() for pid in workers) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not any(Path(f"/proc/{pid}").exists() for pid in workers), "workers outlived their parent"


def test_resume_with_nothing_there_begins(scenegen, here):
    words = [*WORDS, "-n", "40"]
    assert scenegen(*words, "--out", "a.jsonl", "--resume").status == 0
    assert scenegen(*words, "--out", "b.jsonl").status == 0
    assert Path("a.jsonl").read_bytes() == Path("b.jsonl").read_bytes()


@pytest.mark.long
def test_what_many_scenes_say(scenegen, here, small_pictures):
    """The choice is told before the work, the summary covers the whole file, and pictures can follow."""
    done = scenegen(*WORDS, "-n", "20000", "--out", "o.parquet")
    assert (done.status, done.out) == (0, "")
    first, second, *table = done.err.splitlines()
    assert first.startswith("rejection: ") and " in range" in first
    assert second.startswith("20000 scenes (rejection, ") and second.endswith(" in o.parquet")
    phi = read_scenes("o.parquet").phi
    assert f"{phi['task'].min():+.4f}" in table[1] and f"{phi['safe'].mean():+.4f}" in table[2]
    few = scenegen(*WORDS, "-n", "2", "--out", "p.jsonl", "--resume", "--render", "pictures")
    assert few.status == 0 and (here / "pictures" / "scene_0002_top.png").exists()


@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("ending", [".parquet", ".jsonl"])
def test_killed_at_random_moments(workers, ending, here, scenegen):
    chance = random.Random(f"{workers}{ending}")
    words = [*WORDS, "-n", "3000000", "--timeout", "600", "--workers", str(workers)]
    out, part = here / f"o{ending}", here / f"o{ending}.part"
    for _ in range(8):
        process = started([*words, "--out", out.name, "--resume"], here)
        until(lambda: False, process, chance.uniform(1.0, 9.0))
        process.kill()
        process.wait()
        if out.exists() and not part.exists():
            break
    assert scenegen(*words, "--out", out.name, "--resume").status == 0 and not part.exists()
    assert scenegen(*words, "--out", f"whole{ending}").status == 0
    assert out.read_bytes() == (here / f"whole{ending}").read_bytes()


@pytest.mark.slow
def test_ten_million_scenes_at_flat_memory(here):
    """The largest memory of the process with ten million scenes is that with one million, but for some megabytes."""
    peaks = {}
    for n in (1_000_000, 10_000_000):
        words = [
            "sample",
            "good.spec",
            "--phi",
            "0.05:0.3",
            "-n",
            n,
            "--timeout",
            900,
            "--workers",
            1,
            "--out",
            f"{n}.parquet",
        ]
        process = started(words, here)
        _, status, used = os.wait4(process.pid, 0)
        assert os.waitstatus_to_exitcode(status) == 0, process.stderr.read()
        process.returncode = 0
        peaks[n] = used.ru_maxrss / 1024
    assert peaks[10_000_000] < peaks[1_000_000] + 64, peaks
    import pyarrow.parquet as pq

    file = pq.ParquetFile("10000000.parquet")
    assert file.metadata.num_rows == 10_000_000 and file.metadata.num_columns == 7
