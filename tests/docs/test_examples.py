"""Every example runs, and the demo writes what it says."""

import json
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.long
@pytest.mark.parametrize("example", [one for one in EXAMPLES if one.name != "00_demo.py"], ids=lambda path: path.stem)
def test_example(example, tmp_path, warm):
    done = warm.run([example], tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_the_notebook(tmp_path, warm):
    """Its cells run one after the other, and it is stored without outputs."""
    cells = json.loads((ROOT / "examples" / "first_scenes.ipynb").read_text())["cells"]
    programs = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    assert programs and not any(cell.get("outputs") for cell in cells)
    done = warm.run(["-c", "\n".join(programs)], tmp_path)
    assert done.returncode == 0, done.stderr
    assert "did you mean `leftOf`?" in done.stdout


@pytest.mark.long
def test_demo(tmp_path, warm):
    out = tmp_path / "out"
    done = warm.run([ROOT / "examples" / "00_demo.py", "--quick", "--out", out], tmp_path)
    assert done.returncode == 0, done.stderr
    files = ("exact/contact_sheet.png", "exact/scenes.json", "model/contact_sheet.png", "model/scenes.json")
    for file in (*files, "flow.safetensors"):
        assert (out / file).is_file()
        assert str(out / file) in done.stdout.split("Open:")[1]
    # Pictures come first: they are said and drawn before torch is loaded.
    assert done.stdout.index(str(out / files[0])) < done.stdout.index("A trained model")
    assert (out / files[0]).stat().st_mtime < (out / "flow.safetensors").stat().st_mtime
