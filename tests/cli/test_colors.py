"""Colours on a terminal, plain text in a pipe, and the two variables by which people overrule either."""

import os
import pty
import re
import subprocess
import sys

import pytest

BAD = "object mug, plate\ntask: leftOf(mug plate)\nsafe: leftOf(mug,\n"
ESCAPE = re.compile(r"\x1b\[[\d;]*m")


def environment(**variables):
    kept = {name: value for name, value in os.environ.items() if name not in ("NO_COLOR", "FORCE_COLOR", "TERM")}
    return kept | {"TERM": "xterm"} | variables


def complaint(folder, terminal, **variables):
    """Standard error of `scenegen check bad.spec`, on a pseudo-terminal or in a pipe."""
    (folder / "bad.spec").write_text(BAD)
    command = [sys.executable, "-m", "scenegen", "check", "bad.spec"]
    if not terminal:
        done = subprocess.run(command, cwd=folder, env=environment(**variables), capture_output=True, timeout=60)
        assert (done.returncode, done.stdout) == (1, b"")
        return done.stderr.decode()
    ours, theirs = pty.openpty()
    try:
        done = subprocess.run(
            command, cwd=folder, env=environment(**variables), stdout=subprocess.PIPE, stderr=theirs, timeout=60
        )
        os.close(theirs)
        said = b""
        while chunk := _read(ours):
            said += chunk
    finally:
        os.close(ours)
    assert (done.returncode, done.stdout) == (1, b"")
    return said.decode().replace("\r\n", "\n")


def _read(handle):
    try:
        return os.read(handle, 65536)
    except OSError:  # how Linux says that the other side of a terminal is gone
        return b""


@pytest.mark.parametrize(
    ("terminal", "variables", "colored"),
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
def test_colors(tmp_path, terminal, variables, colored):
    said = complaint(tmp_path, terminal, **variables)
    assert ("\x1b[1;31merror" in said) == bool(ESCAPE.search(said)) == colored
    assert ESCAPE.sub("", said).count("error: ") == 2
