"""Jobs must be importable by worker processes, which get this process's search path."""

import contextlib
import sys
from pathlib import Path

import pytest

from scenegen.scenes.formats.registry import FORMATS

HERE = Path(__file__).parent


@pytest.fixture(autouse=True)
def importable(monkeypatch):
    monkeypatch.syspath_prepend(str(HERE))


@pytest.fixture(autouse=True)
def no_orphans(_forks):
    """Whatever a test does, no process of its own is left when it ends."""
    before = children()
    yield
    assert children() - before <= {_forks.pid}


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


@pytest.fixture(scope="module")
def unbroken(tmp_path_factory):
    """The files of runs that nothing disturbed, by ending."""
    sys.path.insert(0, str(HERE))
    try:
        from made import Made, stream
    finally:
        sys.path.remove(str(HERE))
    folder = tmp_path_factory.mktemp("unbroken")
    for ending in FORMATS:
        stream(folder / f"x{ending}", Made(2000), size=300)
    return {ending: (folder / f"x{ending}").read_bytes() for ending in FORMATS}
