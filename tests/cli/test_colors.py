"""Colours on a terminal, plain text in a pipe, and the two variables by which people overrule either."""

import os
import pty
import re
import subprocess
import sys

import pytest

from scenegen.cli.app import run

BAD = "object mug, plate\ntask: leftOf(mug plate)\nsafe: leftOf(mug,\n"
ESCAPE = re.compile(r"\x1b\[[\d;]*m")


@pytest.fixture
def bad(tmp_path, monkeypatch):
    """A spec with two mistakes, in a terminal whose variables say nothing about colours."""
    (tmp_path / "bad.spec").write_text(BAD)
    for name in ("NO_COLOR", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    return tmp_path / "bad.spec"


@pytest.fixture
def terminal():
    """The two sides of a pseudo-terminal: what the first reads is written to the second."""
    ours, theirs = pty.openpty()
    yield ours, theirs
    os.close(ours)


def everything(ours, theirs):
    """What was written, once the other side is closed."""
    os.close(theirs)
    said = b""
    while chunk := _read(ours):
        said += chunk
    return said.decode().replace("\r\n", "\n")


def _read(handle):
    try:
        return os.read(handle, 65536)
    except OSError:  # how Linux says that the other side of a terminal is gone
        return b""


@pytest.mark.parametrize(
    ("on_terminal", "variables", "colored"),
    [
        (True, {}, True),
        (False, {}, False),
        (True, {"NO_COLOR": "1"}, False),
        (True, {"NO_COLOR": ""}, True),
        (True, {"TERM": "dumb"}, False),
        (False, {"FORCE_COLOR": "1"}, True),
        (True, {"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
    ],
)
def test_colors(bad, terminal, monkeypatch, capfd, on_terminal, variables, colored):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    if on_terminal:
        with monkeypatch.context() as patch, open(terminal[1], "w", closefd=False) as stderr:
            patch.setattr(sys, "stderr", stderr)
            status = run(["check", str(bad)])
        said = everything(*terminal)
    else:
        status = run(["check", str(bad)])
        said = capfd.readouterr().err
        os.close(terminal[1])
    assert status == 1 and ("\x1b[1;31merror" in said) == bool(ESCAPE.search(said)) == colored
    assert ESCAPE.sub("", said).count("error[") == 2


@pytest.mark.long
def test_the_program_itself_on_a_terminal(bad, terminal):
    command = [sys.executable, "-m", "scenegen", "check", str(bad)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=terminal[1], timeout=60)
    said = everything(*terminal)
    assert (done.returncode, done.stdout) == (1, b"") and "\x1b[1;31merror" in said
