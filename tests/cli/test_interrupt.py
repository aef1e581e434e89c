"""Ctrl-C and SIGTERM, sent to real processes: status 130, a word about what is left, nothing half done."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest


def started(words, cwd):
    environment = os.environ | {"TERM": "dumb", "PYTHONUNBUFFERED": "1"}
    command = [sys.executable, "-m", "scenegen", *words]
    pipe = subprocess.PIPE
    return subprocess.Popen(command, cwd=cwd, env=environment, stdout=pipe, stderr=pipe, text=True)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_training_leaves_a_usable_model(number, here, scenegen):
    words = ["train", "good.spec", "--model", "gan", "--scenes", "640", "--epochs", "100000", "--out", "m.safetensors"]
    process = started(words, here)
    first = process.stderr.readline()
    assert first.startswith("gan: epoch 1/100000")
    process.send_signal(number)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out) == (130, "")
    last = err.splitlines()[-1]
    assert last.startswith("stopped after ") and last.endswith("go on with --resume --out m.safetensors")
    assert sorted(path.name for path in here.glob("m*")) == ["m.safetensors", "m.safetensors.train"]
    drawn = scenegen("sample", "m.safetensors", "-n", "4", "--raw")
    assert drawn.status == 0 and len(json.loads(drawn.out)["scenes"]) == 4
    done = int(last.split()[2])
    more = scenegen(*words[:6], "--epochs", str(done + 1), "--out", "m.safetensors", "--resume")
    assert more.status == 0, more.err


def test_sampling_a_rare_range(here):
    # out of reach, and nothing but a long search can tell
    circle = "sin(theta(mug)) * sin(theta(mug)) + cos(theta(mug)) * cos(theta(mug)) <= 0.9999"
    (here / "rare.spec").write_text(f"leftOf(mug, plate) & {circle}")
    process = started(["sample", "rare.spec", "--phi", "0:", "-n", "1000", "--out", "o.json"], here)
    deadline = time.monotonic() + 30
    while not _samples(process) and time.monotonic() < deadline:
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert (process.returncode, out, err) == (130, "", "interrupted\n")
    assert sorted(path.name for path in here.iterdir()) == ["forks.spec", "good.spec", "rare.spec", "two.spec"]


def _samples(process):
    """Whether the process has come so far that torch works: its library is mapped, and CPU time used."""
    folder = Path("/proc", str(process.pid))
    used = int((folder / "stat").read_text().rsplit(")", 1)[1].split()[11]) / os.sysconf("SC_CLK_TCK")
    return used > 2.5 and "libtorch" in (folder / "maps").read_text()
