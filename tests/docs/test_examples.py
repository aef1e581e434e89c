"""Every example runs, and the demo writes what it says."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.parametrize("example", [one for one in EXAMPLES if one.name != "00_demo.py"], ids=lambda path: path.stem)
def test_example(example, tmp_path):
    done = subprocess.run([sys.executable, example], cwd=tmp_path, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert not list(tmp_path.iterdir())


def test_demo(tmp_path):
    small = ["--epochs", "1", "--scenes", "1000", "-n", "3", "--out", tmp_path / "out"]
    command = [sys.executable, ROOT / "examples" / "00_demo.py", *small]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    for name in ("gan", "aae", "energy"):
        for file in (f"{name}.safetensors", f"{name}.json", f"{name}-pictures/contact_sheet.png"):
            assert (tmp_path / "out" / file).is_file()
            assert file in done.stdout
        assert len(list((tmp_path / "out" / f"{name}-pictures").glob("scene_*.png"))) == 6
