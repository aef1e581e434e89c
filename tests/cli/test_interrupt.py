"""Ctrl-C, SIGTERM and SIGHUP, sent to real processes: the status that a shell expects, a word about what is left,
nothing half done. kill -9, then --resume: the same bytes as a run that nothing disturbed. Several inputs of one
command: a job each, the bad ones named, the bytes those of one at a time.
"""

import json
import math
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from scenegen.api.reading import read_scenes


def started(words, cwd):
    environment = os.environ | {"TERM": "dumb", "PYTHONUNBUFFERED": "1"}
    command = [sys.executable, "-m", "scenegen", *words]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=cwd, env=environment, stdout=pipe, stderr=pipe, text=True)


@pytest.mark.usefixtures("interruptible")
@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_training_leaves_a_usable_model(number, here, scenegen):
    words = [
        "train",
        "good.spec",
        "--model",
        "gan",
        "--data",
        "uniform",
        "--scenes",
        "640",
        "--epochs",
        "100000",
        "--out",
        "m.safetensors",
    ]
    process = started(words, here)
    first = process.stderr.readline()
    assert first.startswith("gan: epoch 1/100000")
    process.send_signal(number)
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out) == (128 + number, "")
    last = err.splitlines()[-1]
    assert last.startswith("stopped after ") and last.endswith("go on with `--resume --out m.safetensors`")
    assert sorted(path.name for path in here.glob("m*")) == ["m.safetensors", "m.safetensors.train"]
    drawn = scenegen("sample", "m.safetensors", "-n", "4", "--raw")
    assert drawn.status == 0 and len(json.loads(drawn.out)["scenes"]) == 4
    done = int(last.split()[2])
    more = scenegen(*words[:8], "--epochs", str(done + 1), "--out", "m.safetensors", "--resume")
    assert more.status == 0, more.err


HOPELESS = "leftOf(a, b) & sin(theta(a)) * sin(theta(a)) + cos(theta(a)) * cos(theta(a)) <= 0.9999"


@pytest.mark.usefixtures("interruptible")
@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_sampling_what_is_not_found(number, here):
    (here / "never.spec").write_text(HOPELESS)
    process = started(["sample", "never.spec", "--method", "rejection", "--phi", "0:", "--out", "o.json"], here)
    deadline = time.monotonic() + 30
    while _used(process) < 1.2 and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(number)
    out, err = process.communicate(timeout=120)
    said = "interrupted\n" if number == signal.SIGINT else "terminated\n"
    assert (process.returncode, out, err) == (128 + number, "", said)
    assert sorted(path.name for path in here.iterdir()) == ["forks.spec", "good.spec", "never.spec", "two.spec"]


@pytest.mark.usefixtures("interruptible")
@pytest.mark.long
@pytest.mark.parametrize("workers", ["1", pytest.param("2", marks=pytest.mark.slow)])  # two: test_resume.py
def test_many_scenes_are_kept_and_gone_on_with(workers, here, scenegen):
    """Ctrl-C in the midst of many scenes; what is there goes on to the same bytes as a run without a break."""
    words = ["sample", "two.spec", "--phi", "task=0.4:", "-n", "700000", "--seed", "3", "--workers", workers]
    process = started([*words, "--out", "o.parquet"], here)
    part = here / "o.parquet.part"
    deadline = time.monotonic() + 60
    begun = math.inf
    while process.poll() is None and time.monotonic() < deadline and _used(process) < begun + 0.1:
        if begun == math.inf and (part / "manifest.json").exists():
            begun = _used(process)
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert (process.returncode, out) == (130, "")
    assert err.splitlines()[-1].startswith("interrupted; ") and err.endswith(" scenes: go on with --resume\n")
    assert part.is_dir() and not (here / "o.parquet").exists()
    refused = scenegen(*words, "--out", "o.parquet")
    assert refused.status == 1 and "go on with --resume" in refused.err
    assert scenegen(*words, "--out", "o.parquet", "--resume").status == 0
    assert scenegen(*words, "--out", "whole.parquet").status == 0
    assert (here / "o.parquet").read_bytes() == (here / "whole.parquet").read_bytes() and not part.exists()


def _used(process):
    """Seconds of CPU time, without the system's."""
    fields = Path("/proc", str(process.pid), "stat").read_text().rsplit(")", 1)[1].split()
    return int(fields[11]) / os.sysconf("SC_CLK_TCK")


@pytest.mark.usefixtures("interruptible")
@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_nothing_of_a_file_that_is_being_written_is_left(number, here):
    """The signal reaches the whole group, as that of a terminal which is closed does, and twice."""
    environment = os.environ | {"TMPDIR": str(here / "tmp")}
    (here / "tmp").mkdir()
    words = ["pairs", "two.spec", "-n", "2000000", "--workers", "2", "--out", "o.parquet", "--timeout", "600"]
    command = [sys.executable, "-m", "scenegen", *words]
    pipe = subprocess.PIPE
    process = subprocess.Popen(command, cwd=here, env=environment, stderr=pipe, text=True, start_new_session=True)
    until = time.monotonic() + 60
    while _used(process) < 1.5 and time.monotonic() < until:
        time.sleep(0.02)
    for _ in range(2):
        os.killpg(process.pid, number)
    err = process.communicate(timeout=60)[1]
    assert (process.returncode, err) == (128 + number, "terminated\n")
    left = {path.name for path in here.rglob("*")}
    assert left == {"tmp", "forks.spec", "good.spec", "two.spec"}


@pytest.mark.usefixtures("interruptible")
@pytest.mark.long
def test_a_program_that_ignores_the_end_of_its_terminal(here):
    """`nohup scenegen ...`"""
    command = ["nohup", sys.executable, "-m", "scenegen", "sample", "two.spec", "--phi", "task=0:", "-n", "100"]
    process = subprocess.Popen(command, cwd=here, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    time.sleep(0.5)
    process.send_signal(signal.SIGHUP)
    assert process.wait(60) == 0


CUTS = """
import numpy as np
from scenegen.worlds.own_body import convex_pieces
from scenegen.things.mesh import box, join
draw = np.random.default_rng(0).uniform
convex_pieces(join([box(*draw(0.1, 1.0, 3)).shift(*draw(0.0, 2.0, 3)) for _ in range(60)]))
"""


@pytest.mark.usefixtures("interruptible")
@pytest.mark.long
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="finds processes as Linux lists them")
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM])
def test_a_mesh_that_is_being_cut_ends_with_its_parent(number, tmp_path):
    pytest.importorskip("coacd")
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path)}
    parent = subprocess.Popen([sys.executable, "-c", CUTS], env=environment)
    children = Path(f"/proc/{parent.pid}/task/{parent.pid}/children")
    until = time.monotonic() + 60
    while not (found := children.read_text().split()) and time.monotonic() < until:
        time.sleep(0.02)
    cutter = Path("/proc", found[0], "stat")
    while int(cutter.read_text().split()[13]) < 150 and time.monotonic() < until:  # hundredths: it is in CoACD
        time.sleep(0.02)
    parent.send_signal(number)
    parent.wait(10)
    while cutter.exists() and " Z " not in cutter.read_text() and time.monotonic() < until:
        time.sleep(0.02)
    assert not cutter.exists() or " Z " in cutter.read_text()
    assert not list(tmp_path.rglob("*.npz"))


COUNT = "300000"  # twenty blocks: enough to be broken off twice
WORDS = ["sample", "two.spec", "--phi", "task=-0.4:0.4", "--phi", "safe=0:", "--seed", "8"]


def started_resume(words, cwd):
    # a group of its own: its workers are ended by the end of their pipes, as they must be
    command = [sys.executable, "-m", "scenegen", *map(str, words)]
    return subprocess.Popen(command, cwd=cwd, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)


def shards(folder):
    return len(list(folder.glob("part-*.npy"))) if folder.exists() else 0


def until(condition, process, seconds=60):
    deadline = time.monotonic() + seconds
    while not condition() and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)


def children(pid):
    tasks = Path(f"/proc/{pid}/task")
    return {int(one) for task in tasks.iterdir() for one in (task / "children").read_text().split()}


@pytest.mark.usefixtures("interruptible")
@pytest.mark.long
def test_killed_in_the_midst_of_resuming(here, scenegen):
    """An interrupt leaves a checkpoint; the run that goes on from there is killed; the third completes the file."""
    words = [*WORDS, "-n", COUNT, "--workers", "2", "--out", "o.parquet"]
    part = here / "o.parquet.part"
    first = started_resume(words, here)
    until(lambda: list(part.glob(".part-*")), first)
    first.send_signal(signal.SIGINT)
    assert "go on with --resume" in first.communicate(timeout=60)[1] and first.returncode == 130
    before = shards(part)
    assert before >= 1
    second = started_resume([*words, "--resume"], here)
    until(lambda: list(part.glob(".part-*")), second)
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


@pytest.mark.usefixtures("interruptible")
def test_resume_with_nothing_there_begins(scenegen, here):
    words = [*WORDS, "-n", "40"]
    assert scenegen(*words, "--out", "a.jsonl", "--resume").status == 0
    assert scenegen(*words, "--out", "b.jsonl").status == 0
    assert Path("a.jsonl").read_bytes() == Path("b.jsonl").read_bytes()


@pytest.mark.usefixtures("interruptible")
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


@pytest.mark.usefixtures("interruptible")
@pytest.mark.slow
@pytest.mark.parametrize("workers", [1, 2])
@pytest.mark.parametrize("ending", [".parquet", ".jsonl"])
def test_killed_at_random_moments(workers, ending, here, scenegen):
    chance = random.Random(f"{workers}{ending}")
    words = [*WORDS, "-n", "3000000", "--timeout", "600", "--workers", str(workers)]
    out, part = here / f"o{ending}", here / f"o{ending}.part"
    for _ in range(8):
        process = started_resume([*words, "--out", out.name, "--resume"], here)
        until(lambda: False, process, chance.uniform(1.0, 9.0))
        process.kill()
        process.wait()
        if out.exists() and not part.exists():
            break
    assert scenegen(*words, "--out", out.name, "--resume").status == 0 and not part.exists()
    assert scenegen(*words, "--out", f"whole{ending}").status == 0
    assert out.read_bytes() == (here / f"whole{ending}").read_bytes()


@pytest.mark.usefixtures("interruptible")
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
        process = started_resume(words, here)
        _, status, used = os.wait4(process.pid, 0)
        assert os.waitstatus_to_exitcode(status) == 0, process.stderr.read()
        process.returncode = 0
        peaks[n] = used.ru_maxrss / 1024
    assert peaks[10_000_000] < peaks[1_000_000] + 64, peaks
    import pyarrow.parquet as pq

    file = pq.ParquetFile("10000000.parquet")
    assert file.metadata.num_rows == 10_000_000 and file.metadata.num_columns == 7


@pytest.fixture
def scenes(here, scenegen):
    (here / "bad.json").write_text("{")
    for name in ("good", "forks"):
        assert scenegen("sample", f"{name}.spec", "-n", "2", "--out", f"{name}.json", "-q").status == 0
    return "good.json", "bad.json", "forks.json"


def named(done, name):
    """The command named one failure, did the rest, and ended with status 1."""
    assert done.status == 1 and f"{name} failed:\n" in done.err, done.err
    assert f"error[some-failed]: `{name}` failed" in done.err or f"{name} failed; the others" in done.err


@pytest.mark.long
def test_settle_and_render(scenes, here, scenegen, small_pictures):
    words = ("settle", *scenes, "--in", "pybullet", "--seconds", "0.1", "--workers", "1")
    named(scenegen(*words, "--out", "rest/"), "bad")
    one = scenegen("settle", "forks.json", "--in", "pybullet", "--seconds", "0.1", "--workers", "1", "--out", "f.json")
    assert one.status == 0 and (here / "rest/forks.json").read_bytes() == (here / "f.json").read_bytes()
    assert not (here / "rest/bad.json").exists() and (here / "rest/good.json").exists()
    named(scenegen("render", *scenes, "--out", "pictures", "--workers", "1", "--view", "top"), "bad")
    drawn = sorted(str(path.relative_to(here / "pictures")) for path in (here / "pictures").rglob("*_top.png"))
    assert drawn == [f"{name}/scene_000{number}_top.png" for name in ("forks", "good") for number in (1, 2)]


@pytest.mark.long
def test_train(here, scenegen, monkeypatch):
    (here / "bad.spec").write_text("leftof(mug")
    words = ("train", "--epochs", "1", "--scenes", "64", "--no-card", "--workers", "1", "--hyper", "width=8")
    named(scenegen(*words, "good.spec", "bad.spec", "forks.spec", "--out", "models/"), "bad")
    assert scenegen(*words, "forks.spec", "--out", "alone/", "-q").status == 0
    assert (here / "models/forks.safetensors").read_bytes() == (here / "alone/forks.safetensors").read_bytes()
    monkeypatch.setattr("scenegen.learn.train.train", lambda *_, **__: pytest.fail("trained again"))
    done = scenegen(*words, "good.spec", "forks.spec", "--out", "models/", "--resume")
    assert done.status == 0 and done.err.count("complete already") == 2


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (("settle", "a.json", "b.json", "--out", "one.json"), "folder-for-several"),
        (("settle", "a.json", "x/a.json", "--out", "rest/"), "same-name"),
        (("settle", "a.json", "--out", "one.json", "--engine", "ray"), "only-for-several"),
        (("render", "a.json", "--out", "p", "--address", "here"), "only-for-several"),
        (("render", "a.json", "b.json", "--out", "p", "--engine", "rai"), "unknown-engine"),
        (("train", "good.spec", "two.spec", "--out", "s3://bucket/models/"), "folder-for-several"),
    ],
)
def test_refused(words, code, here, scenegen):
    done = scenegen(*words)
    assert done.status == 1 and f"error[{code}]" in done.err and done.err.count("error[") == 1
    assert not (here / "rest").exists()
