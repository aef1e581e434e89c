"""Ctrl-C and SIGTERM, sent to real processes: status 130, a word about what is left, nothing half done."""

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
    assert (process.returncode, out) == (130, "")
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
def test_sampling_what_is_not_found(here):
    (here / "never.spec").write_text(HOPELESS)
    process = started(["sample", "never.spec", "--method", "rejection", "--phi", "0:", "--out", "o.json"], here)
    deadline = time.monotonic() + 30
    while _used(process) < 1.2 and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=120)
    assert (process.returncode, out, err) == (130, "", "interrupted\n")
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
