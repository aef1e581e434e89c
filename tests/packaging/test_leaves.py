"""The core does without its leaves: a copy of the package without one of them still checks, samples and scores."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
LEAVES = ("learn", "worlds", "planning", "pictures", "editors", "page", "play")
SPEC = "leftOf(mug, plate) & !closeTo(mug, plate, 0.25)\n"
PROGRAM = """
import sys
sys.path.insert(0, sys.argv.pop(1))
import scenegen.cli
scenegen.cli.main()
"""


@pytest.fixture(params=LEAVES)
def without(request, tmp_path):
    """Runs a command of a copy of the package from which one leaf is gone."""
    skipped = shutil.ignore_patterns("__pycache__", "static")
    shutil.copytree(ROOT / "scenegen", tmp_path / "copy/scenegen", ignore=skipped)
    shutil.rmtree(tmp_path / "copy/scenegen" / request.param)
    for folder in ("grammar", "specs"):
        (tmp_path / "copy" / folder).symlink_to(ROOT / folder)

    def run(*words):
        program = [sys.executable, "-c", PROGRAM, str(tmp_path / "copy"), *words]
        return subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, env=dict(os.environ))

    return run


@pytest.mark.long
def test_the_core_does_without_each_leaf(without, tmp_path):
    (tmp_path / "a.spec").write_text(SPEC)
    for words in (
        "check a.spec",
        "fmt --check a.spec",
        "range a.spec",
        "sample a.spec --phi 0:0.2 -n 4 --out s.json",
        "sample a.spec --phi 0:0.2 -n 4 --method splitting --workers 2 --out t.jsonl",
        "sample a.spec --phi 0:0.2 -n 8 --out set/",
        "eval a.spec s.json",
        "data set",
    ):
        done = without(*words.split())
        assert done.returncode == 0, (words, done.stderr)


def test_what_is_behind_a_door_is_gone_with_its_leaf(without, tmp_path):
    """The copy is what runs, not the package that is installed."""
    homes = "; ".join(f"find_spec('scenegen.{leaf}') or print('{leaf}')" for leaf in LEAVES)
    program = (
        f"import sys; sys.path.insert(0, {str(tmp_path / 'copy')!r}); from importlib.util import find_spec; {homes}"
    )
    gone = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, cwd=tmp_path).stdout.split()
    assert len(gone) == 1
