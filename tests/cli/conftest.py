"""The program run in this process, as a user would type it, with what it says and what it leaves behind."""

from __future__ import annotations

import functools
import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import typer

from tests.corpus import read_corpus

PLAIN = {"COLUMNS": "100", "TERM": "dumb", "NO_COLOR": "1"}

GOOD = "object mug, plate\ntask: leftOf(mug, plate)\n"
TWO = "object mug, plate\ntask: leftOf(mug, plate) & aboveOf(mug, plate)\nsafe: !closeTo(mug, plate, 0.25)\n"
FORKS = "object fork, spoon\ntask: leftOf(fork, spoon)\n"


@dataclass(frozen=True)
class Outcome:
    status: int
    out: str
    err: str


def _snapshot(folder: Path) -> dict[str, bytes | None]:
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in folder.rglob("*")}


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty working directory with three small specs."""
    monkeypatch.chdir(tmp_path)
    for name, text in (("good", GOOD), ("two", TWO), ("forks", FORKS)):
        (tmp_path / f"{name}.spec").write_text(text)
    return tmp_path


@pytest.fixture
def plain(monkeypatch):
    for name, value in PLAIN.items():
        monkeypatch.setenv(name, value)


@functools.cache
def _built() -> Any:
    """The program with all its commands, which takes longer to put together than most commands to run."""
    from scenegen.cli.app import build

    return typer.main.get_command(build())


@pytest.fixture
def scenegen(capfd, plain, monkeypatch):
    """scenegen("check", "x.spec") in this process -> Outcome."""
    from scenegen.cli.app import run

    built = _built()
    monkeypatch.setattr("scenegen.cli.app.build", lambda words=None: built)

    def call(*words: str) -> Outcome:
        capfd.readouterr()
        status = run([str(word) for word in words])
        return Outcome(status, *capfd.readouterr())

    return call


@pytest.fixture
def small_pictures(monkeypatch):
    """Pictures are as small as they get where no size is given."""
    monkeypatch.setattr("scenegen.pictures.render.scenes.usual_size", lambda file: (32, 24))


@pytest.fixture
def refused(scenegen, here):
    """Runs a command that must fail: status 1, one diagnostic with help, no output, nothing written."""

    def call(*words: str) -> str:
        before = _snapshot(here)
        outcome = scenegen(*words)
        assert (outcome.status, outcome.out) == (1, "")
        _one_diagnostic(outcome.err)
        assert _snapshot(here) == before
        return outcome.err

    return call


@pytest.fixture
def refusal(refused, message):
    """refusal("requests", "phi_nan"): the command of that case of golden/cli/errors/requests.txt is refused with the
    message beside it, which is returned. `shown` makes of it what is compared."""

    def call(corpus: str, case: str, shown: Callable[[str], str] = str) -> str:
        _, *words = shlex.split(read_corpus(f"cli/errors/{corpus}")[case].text)
        said = shown(refused(*words))
        message(f"cli/errors/{corpus}", case, said)
        return said

    return call


def _one_diagnostic(text: str) -> None:
    lines = text.splitlines()
    assert lines[0].startswith("error[")
    assert sum(line.startswith(("error[", "warning[")) for line in lines) == 1
    assert sum(line.lstrip().startswith("= help:") for line in lines) == 1
    assert "Traceback" not in text
    assert "scenegen itself failed" not in text


@pytest.fixture
def process():
    """process("check", "x.spec") in a process of its own -> CompletedProcess with text."""

    def call(*words: str, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "scenegen", *map(str, words)]
        return subprocess.run(command, cwd=cwd, env=os.environ | PLAIN, capture_output=True, text=True, timeout=60)

    return call


@pytest.fixture
def snapshot():
    """snapshot(folder) -> every file below it with its bytes, every folder with None."""
    return _snapshot


@pytest.fixture
def assert_one_diagnostic():
    return _one_diagnostic
