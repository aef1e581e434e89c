"""Shared by all tests: derived files, which `--regenerate` rewrites (then read the diff before committing it)."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from scenegen.geometry.workspace import Workspace
from scenegen.lang.checker import check_text
from scenegen.lang.spec import CheckedSpec

from . import forks
from .corpus import read_corpus, write_message

if TYPE_CHECKING:
    from .warm import Warm

ROOT = Path(__file__).resolve().parent.parent
DERIVED = "`make derived` rewrites every such file: read the diff"
# folders and files of tests whose workers are started as users' are
REAL = {"packaging", "slow", "test_interrupt.py", "test_plans_travel.py", "test_pool.py", "test_ray.py"}


# Of laws that say no number of examples themselves (tests/laws.py), as many are tried. A busy machine takes its time:
settings.register_profile("quick", max_examples=25, deadline=None)
settings.register_profile("full", max_examples=100, deadline=None)
settings.load_profile("full" if os.environ.get("HYPOTHESIS_PROFILE") == "full" else "quick")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Importing all tests and torch makes a million objects that stay: looking for garbage among them, then and later,
    took a quarter of the time of collection, and half a second each time."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--regenerate", action="store_true", help="rewrite derived files instead of comparing with them")


def pytest_configure(config: pytest.Config) -> None:
    config.addinivalue_line("markers", "derived: compares with a file that `make derived` rewrites")


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Tests of files that are derived have the mark `derived`: `make derived` runs them with --regenerate."""
    for item in items:
        if {"derived", "message"} & set(getattr(item, "fixturenames", ())):
            item.add_marker("derived")


@pytest.fixture
def derived(request: pytest.FixtureRequest) -> Callable[[str, str], None]:
    """derived("docs/llms.txt", text) compares a text with a file of the repository that is made, not written."""

    def compare(name: str, text: str) -> None:
        path = ROOT / name
        if request.config.getoption("--regenerate"):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
            return
        assert path.exists(), f"no file {name}; {DERIVED}"
        assert text == path.read_text(encoding="utf-8"), f"{name} is not what is made now; {DERIVED}"

    return compare


@pytest.fixture
def golden(derived: Callable[[str, str], None]) -> Callable[[str, str], None]:
    """golden("lang/trees/first.txt", text) compares a text with a file below tests/golden."""
    return lambda name, text: derived(f"tests/golden/{name}", text)


@pytest.fixture
def message(request: pytest.FixtureRequest) -> Callable[[str, str, str], None]:
    """message("lang/errors/names", "miscased", text) compares a text with the message of a case of a corpus."""

    def compare(name: str, case: str, text: str) -> None:
        if request.config.getoption("--regenerate"):
            write_message(name, case, text.rstrip("\n"))
            return
        cases = read_corpus(name)
        assert case in cases, f"no case {case} in tests/golden/{name}.txt: write its input there (tests/corpus.py)"
        assert text.rstrip("\n") == cases[case].message, f"differs from {case} in tests/golden/{name}.txt; {DERIVED}"

    return compare


@pytest.fixture
def interruptible() -> Iterator[None]:
    """SIGINT interrupts this process and those that it starts, even where the shell had it ignored (`make test &`)."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, signal.SIG_DFL if before is None else before)


@pytest.fixture(scope="session")
def warm() -> Iterator[Warm]:
    """warm.run(["-c", "import torch"], cwd) runs a Python program in a process of its own that has torch loaded."""
    from .warm import Warm

    started = Warm()
    yield started
    started.close()


@pytest.fixture(scope="session")
def _forks() -> Iterator[forks.Server]:
    server = forks.Server()
    yield server
    server.close()


@pytest.fixture(autouse=True)
def forked_workers(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, _forks: forks.Server) -> None:
    """Workers of pools come from one process that has everything loaded, but where processes are what is tested."""
    if not REAL & set(request.path.relative_to(ROOT / "tests").parts):
        starts = SimpleNamespace(Popen=partial(forks.Forked, _forks), PIPE=forks.PIPE)
        monkeypatch.setattr("scenegen.processes.process.subprocess", starts)


@pytest.fixture
def root() -> Path:
    """The repository."""
    return ROOT


def exp1_spec(workspace: Workspace | None = None, closeness: float = 0.25, name: str = "exp1.spec") -> CheckedSpec:
    """Experiment 1, in another workspace or with another tolerance if wanted."""
    lines = ["task: leftOf(mug, plate) & aboveOf(mug, plate)", f"safe: !closeTo(mug, plate, {closeness})"]
    if workspace is not None:
        (left, right), (bottom, top) = workspace.x, workspace.y
        lines.insert(0, f"workspace [{left!r}, {right!r}] x [{bottom!r}, {top!r}]")
    return check_text("\n".join(lines), name)


@pytest.fixture
def exp1() -> CheckedSpec:
    return exp1_spec()


@pytest.fixture
def make_exp1() -> Callable[..., CheckedSpec]:
    return exp1_spec
