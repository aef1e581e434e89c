"""Jobs must be importable by worker processes, which get this process's search path."""

import contextlib
import sys
from pathlib import Path

import pytest


@pytest.fixture(autouse=True)
def importable(monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parent))


@pytest.fixture(autouse=True)
def no_orphans():
    """Whatever a test does, no process of its own is left when it ends."""
    before = children()
    yield
    assert children() <= before


def children():
    if not sys.platform.startswith("linux"):
        return set()
    found = set()
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(
            FileNotFoundError, ProcessLookupError
        ):  # a thread that has ended since has no children
            found |= {int(one) for one in (task / "children").read_text().split()}
    return found
