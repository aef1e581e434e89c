"""`scenegen lsp` before it serves; what it serves is in tests/lsp."""

import subprocess
import sys

import pytest


def test_without_pygls(scenegen, monkeypatch, assert_one_diagnostic):
    for name in [one for one in sys.modules if one.startswith(("pygls", "scenegen.editors.lsp"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "pygls.lsp.server", None)
    monkeypatch.setitem(sys.modules, "pygls.exceptions", None)
    outcome = scenegen("lsp")
    assert (outcome.status, outcome.out) == (1, "")
    assert_one_diagnostic(outcome.err)
    assert 'pip install "scenegen[lsp]"' in outcome.err


def test_a_root_that_is_no_folder(scenegen, tmp_path, assert_one_diagnostic):
    outcome = scenegen("lsp", "--root", str(tmp_path / "none"))
    assert (outcome.status, outcome.out) == (1, "")
    assert_one_diagnostic(outcome.err)


@pytest.mark.long
def test_it_ends_with_its_input():
    """An editor that dies closes the pipe; nobody is left behind, and nothing was printed."""
    command = [sys.executable, "-m", "scenegen", "lsp"]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=60)
    assert (done.stdout, done.returncode) == (b"", 0)
