"""Ctrl-C, SIGTERM and SIGHUP, sent to real processes: the status that a shell expects, a word about what is left,
nothing half done."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.usefixtures("interruptible")


def started(words, cwd):
    environment = os.environ | {"TERM": "dumb", "PYTHONUNBUFFERED": "1"}
    command = [sys.executable, "-m", "scenegen", *words]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=cwd, env=environment, stdout=pipe, stderr=pipe, text=True)


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.slow)])
def test_training_leaves_a_usable_model(number, here, scenegen):
    words = [
        "train",
        "good.spec",
        "--model",
        "gan",
        "--recipe",
        "paper",
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


@pytest.mark.long
@pytest.mark.parametrize("workers", ["1", pytest.param("2", marks=pytest.mark.slow)])  # two: test_resume.py
def test_many_scenes_are_kept_and_gone_on_with(workers, here, scenegen):
    """Ctrl-C in the midst of many scenes; what is there goes on to the same bytes as a run without a break."""
    words = ["sample", "two.spec", "--phi", "task=0.4:", "-n", "250000", "--seed", "3", "--workers", workers]
    process = started([*words, "--out", "o.parquet"], here)
    part = here / "o.parquet.part"
    deadline = time.monotonic() + 60
    while not list(part.glob("shard-*")) and process.poll() is None and time.monotonic() < deadline:
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
from scenegen.things.mesh import box, joined
draw = np.random.default_rng(0).uniform
convex_pieces(joined([box(*draw(0.1, 1.0, 3)).moved(*draw(0.0, 2.0, 3)) for _ in range(60)]))
"""


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
