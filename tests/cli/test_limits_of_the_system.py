"""Where the system lets no more processes, threads or files begin: one plain error."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scenegen.cli import app

AS_ANOTHER = ["setpriv", "--reuid=12345", "--regid=12345", "--clear-groups"]
CAPS = "dac_override,+dac_read_search"  # reads and writes what root may; no more processes than others
AS_ANOTHER += [f"--{kind}=-all,+{CAPS}" for kind in ("inh-caps", "ambient-caps", "bounding-set")]
WORDS = ["sample", "good.spec", "--phi", "0:0.2", "-n", "70000", "--workers", "6", "--out", "set/"]


@pytest.mark.parametrize(
    "error", [RuntimeError("can't start new thread"), OSError(11, os.strerror(11)), OSError(24, os.strerror(24))]
)
def test_a_thread_that_cannot_start(error, scenegen, here, monkeypatch, assert_one_diagnostic):
    def fails(*_, **__):
        raise error

    monkeypatch.setattr(app, "build", lambda words: fails)
    said = scenegen("check", "good.spec").err
    assert "error[cannot-start-process]: cannot start a process or thread: " in said
    assert_one_diagnostic(said)


def test_libraries_that_find_no_memory(scenegen, here, monkeypatch, assert_one_diagnostic):
    def fails(*_, **__):
        raise ImportError("libtorch_cpu.so: failed to map segment from shared object")

    monkeypatch.setattr(app, "build", lambda words: fails)
    said = scenegen("check", "good.spec").err
    assert "error[out-of-memory]" in said
    assert_one_diagnostic(said)


@pytest.mark.long
@pytest.mark.skipif(shutil.which("setpriv") is None or os.geteuid() != 0, reason="needs another user")
@pytest.mark.parametrize("limit", ["-u 2", "-u 5", "-u 8", "-n 14"])
def test_few_processes_or_files(limit, here, assert_one_diagnostic):
    here.chmod(0o777)
    program = [str(Path(sys.executable).with_name("scenegen")), *WORDS]
    words = [*AS_ANOTHER, "bash", "-c", f'ulimit {limit}; exec "$@"', "x", *program]
    environment = {name: value for name, value in os.environ.items() if not name.endswith("_NUM_THREADS")}
    done = subprocess.run(words, cwd=here, env=environment, capture_output=True, text=True, timeout=120)
    lines = [line for line in done.stderr.splitlines() if not line.startswith(("<jemalloc>", "rejection: "))]
    assert done.returncode == 1 and "error[cannot-start-process]" in lines[0]
    assert_one_diagnostic("\n".join(lines))
