"""`import scenegen` is light, and every public name is there."""

import subprocess
import sys

import pytest

import scenegen

PROGRAM = "import sys, scenegen{more}; print(*sorted({{'torch', 'pybullet', 'pydantic', 'PIL'}} & set(sys.modules)))"


@pytest.mark.parametrize(
    "more, loaded",
    [
        ("", ""),
        ("; dir(scenegen); scenegen.__version__", ""),
        ("; scenegen.parse('leftOf(mug, plate)').bounds()", ""),
        ("; scenegen.SceneSet", "pydantic"),
    ],
)
def test_what_is_loaded(more, loaded):
    command = [sys.executable, "-c", PROGRAM.format(more=more)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == loaded


def test_every_public_name():
    for name in scenegen.__all__:
        assert getattr(scenegen, name) is not None
    assert dir(scenegen) == sorted(scenegen.__all__)
    with pytest.raises(AttributeError, match="no attribute 'sampel'"):
        scenegen.sampel  # noqa: B018


def test_errors_are_what_they_say():
    assert issubclass(scenegen.SpecError, ValueError) and issubclass(scenegen.SpecError, scenegen.ScenegenError)
    assert issubclass(scenegen.RequestError, ValueError) and issubclass(scenegen.DataError, ValueError)
    assert issubclass(scenegen.OutputError, OSError)


def test_a_scene_set_draws_itself_again_and_again(tmp_path):
    program = """
import scenegen
scenes = scenegen.sample(scenegen.parse("leftOf(mug, plate)"), n=1)
for number in range(2):
    scenes.render(f"out{number}", size=(32, 32), workers=1)
"""
    subprocess.run([sys.executable, "-c", program], cwd=tmp_path, check=True, timeout=60)
    assert sorted(path.name for path in (tmp_path / "out1").iterdir()) == [
        "cameras.json",
        "contact_sheet.png",
        "scene_0001_perspective.png",
        "scene_0001_top.png",
    ]
