"""`scenegen suite metaworld` where Meta-World is not installed: test_in_metaworld.py has all else."""

import sys

import pytest

from scenegen.errors import RequestError
from scenegen.errors.requests import NOT_INSTALLED
from scenegen.play.suites.harnesses.metaworld import write_metaworld


def test_without_meta_world(small, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "metaworld", None)
    with pytest.raises(RequestError, match="metaworld") as caught:
        write_metaworld(small, tmp_path / "tasks.pkl")
    assert caught.value.diagnostics[0].kind is NOT_INSTALLED and not (tmp_path / "tasks.pkl").exists()
