"""Memory that is kept: fewer page faults, unless the user has decided otherwise."""

import ctypes
import os
import subprocess
import sys

import pytest

from scenegen.processes.process import environment
from scenegen.processes.worker import VARIABLES

PROGRAM = """
import resource, sys
import numpy as np
from scenegen.processes.worker import keep_memory
if sys.argv[1] == "kept":
    keep_memory()
for _ in range(100):  # four arrays of 1 MB that come and go
    arrays = [np.ones(1 << 17) for _ in range(4)]
    del arrays
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(100):
    arrays = [np.ones(1 << 17) for _ in range(4)]
    del arrays
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


def faults(how, **more):
    env = {name: value for name, value in os.environ.items() if name not in VARIABLES} | more
    run = subprocess.run([sys.executable, "-c", PROGRAM, how], capture_output=True, text=True, env=env, check=True)
    return int(run.stdout)


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="not glibc")
def test_pages_are_kept_for_the_next_arrays():
    free = faults("left", MALLOC_TRIM_THRESHOLD_="131072")
    assert free > 10_000 and faults("kept") < 0.1 * free
    assert faults("kept", MALLOC_TRIM_THRESHOLD_="131072") > 10_000  # the user has said so


def test_workers_keep_theirs_unless_the_environment_says_otherwise(monkeypatch):
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    assert VARIABLES.items() <= environment().items()
    monkeypatch.setenv("MALLOC_TRIM_THRESHOLD_", "1000")
    assert environment()["MALLOC_TRIM_THRESHOLD_"] == "1000"
