"""`import scenegen` is light, and every public name is there."""

import subprocess
import sys

import pytest

import scenegen

PROGRAM = """
import sys

def loaded():
    print(*sorted({'torch', 'pybullet', 'pydantic', 'PIL'} & set(sys.modules)))

import scenegen
loaded()
dir(scenegen), scenegen.__version__
loaded()
scenegen.parse('leftOf(mug, plate)').bounds()
loaded()
scenegen.SceneSet
loaded()
"""


@pytest.mark.long
def test_what_is_loaded():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.splitlines() == ["", "", "", "pydantic"]


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


@pytest.mark.long
def test_a_scene_set_draws_itself_again_and_again(tmp_path):
    scenes = scenegen.sample(scenegen.parse("leftOf(mug, plate)"), n=1)
    for number in range(2):
        scenes.render(tmp_path / f"out{number}", size=(32, 32), workers=1)
    assert sorted(path.name for path in (tmp_path / "out1").iterdir()) == [
        "cameras.json",
        "contact_sheet.png",
        "scene_0001_perspective.png",
        "scene_0001_top.png",
    ]
