"""The same seed gives the same bytes, in another process and on other threads."""

import os
import subprocess
import sys

import pytest

from scenegen.api.sample import sample
from scenegen.api.spec import load
from scenegen.resources import shipped_specs
from scenegen.scenes.formats.scenes_json import dump

SPEC = shipped_specs()["mug_left_of_plate"]
WORDS = ["sample", str(SPEC), "--phi", "task=0.05:0.2", "--phi", "safe=0:", "-n", "200", "--seed", "11"]


def in_a_process(threads, *more):
    environment = os.environ | {"OMP_NUM_THREADS": str(threads), "PYTHONHASHSEED": str(threads)}
    command = [sys.executable, "-m", "scenegen", *WORDS, *more]
    return subprocess.run(command, capture_output=True, env=environment, check=True, timeout=60).stdout


@pytest.mark.long
def test_bytes():
    one = in_a_process(1)
    assert in_a_process(2, "--timeout", "33") == one
    here = sample(load(SPEC), {"task": (0.05, 0.2), "safe": (0.0, None)}, n=200, seed=11)
    assert dump(here.file()) == one


def test_another_seed_and_another_count():
    spec = load(SPEC)
    runs = [sample(spec, {"task": (0.05, 0.2)}, n=100, seed=seed).poses for seed in (0, 1, 2**63 - 1)]
    scenes = {scene.tobytes() for poses in runs for scene in poses}
    assert len(scenes) == 300
