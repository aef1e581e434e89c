"""SceneSet: arrays, items, files."""

import math

import numpy as np
import pytest

import scenegen
from scenegen.sampling.request import Range


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse("object mug, plate\ntask: leftOf(mug, plate)\nsafe: farFrom(mug, plate)")


@pytest.fixture(scope="module")
def scenes(spec):
    return scenegen.sample(spec, {"task": (0.1, 0.3), "safe": (0.0, None)}, n=12, seed=2)


def test_arrays(scenes):
    assert len(scenes) == 12 and scenes.objects == ("mug", "plate")
    assert scenes.poses.shape == (12, 2, 3) and scenes.poses.dtype == np.float64
    assert set(scenes.phi) == {"task", "safe"} and scenes.phi["task"].shape == (12,)
    (mug, plate) = scenes.poses[:, 0], scenes.poses[:, 1]
    np.testing.assert_allclose(scenes.phi["task"], plate[:, 0] - mug[:, 0], rtol=0, atol=1e-15)


def test_items(scenes):
    items = list(scenes)
    assert len(items) == 12 and items[3] == scenes[3] and items[-1] == scenes[-1]
    assert scenes[3].poses["plate"].theta == scenes.poses[3, 1, 2]
    assert scenes[3].phi == {label: values[3] for label, values in scenes.phi.items()}
    with pytest.raises(IndexError):
        scenes[12]


def test_what_it_says_of_itself(scenes):
    low, high = scenes.phi["task"].min(), scenes.phi["task"].max()
    assert repr(scenes).startswith(f"<SceneSet: 12 scenes of mug, plate; phi task {low:.3g}..{high:.3g}, safe ")


def test_files(scenes, tmp_path):
    path = scenes.save(str(tmp_path / "s.json"))
    again = scenegen.read_scenes(path)
    assert np.array_equal(again.poses, scenes.poses)
    assert again.file() == scenes.file()
    assert again.header.request.phi == {"task": (0.1, 0.3), "safe": (0.0, None)}
    with pytest.raises(scenegen.RequestError, match="not a format"):
        scenes.save(tmp_path / "s.png")
    with pytest.raises(scenegen.DataError, match="no such file"):
        scenegen.read_scenes(tmp_path / "t.json")


@pytest.mark.long
def test_pictures(scenes, tmp_path):
    drawn = scenes.render(tmp_path / "pictures", size=(32, 24), workers=1, views=("top",))
    assert [path.name for path in drawn.pictures][:2] == ["scene_0001_top.png", "scene_0002_top.png"]
    assert len(drawn.pictures) == 12 and drawn.sheet.exists()


def test_ranges_in_every_form(spec):
    for wanted in ((0.1, 0.3), Range(0.1, 0.3), [0.1, 0.3]):
        assert len(scenegen.sample(spec, {"task": wanted}, n=2)) == 2
    assert len(scenegen.sample(spec)) == 16


@pytest.mark.parametrize(
    "options, said",
    [
        ({"method": "modle"}, "did you mean `model`"),
        ({"method": "model"}, "needs a trained model"),
        ({"raw": True}, "no model takes part"),
        ({"timeout": 0}, "timeout"),
        ({"timeout": math.nan}, "timeout"),
        ({"n": 0}, "`n` is 0"),
        ({"phi": {"tsak": (0, 1)}}, "did you mean `task`"),
        ({"phi": {"task": 0.1}}, "lowest, highest"),
        ({"phi": 0.1}, "2 labels, `task` and `safe`"),
        ({"phi": "task=0:1"}, "2 labels"),
        ({"n": 2.0}, "a whole number"),
        ({"seed": "1"}, "a whole number"),
        ({"timeout": "1"}, "positive number"),
        ({"fix": "mug"}, "by name"),
    ],
)
def test_requests_that_cannot_be(spec, options, said):
    with pytest.raises(scenegen.RequestError, match=said):
        scenegen.sample(spec, **options)


@pytest.mark.parametrize("wanted", [(0.1, 0.3), [0.1, 0.3], Range(0.1, 0.3)])
def test_a_lone_range_is_of_the_lone_label(wanted):
    phi = scenegen.sample(scenegen.parse("leftOf(mug, plate)"), wanted, n=2).phi["task"]
    assert 0.1 <= phi.min() <= phi.max() <= 0.3


def test_a_lone_range_needs_a_lone_label():
    two = scenegen.parse("easy: leftOf(mug, plate)\nnear: closeTo(mug, plate, 0.2)")
    with pytest.raises(scenegen.RequestError, match=r'phi={"easy": \(lowest, highest\)}'):
        scenegen.sample(two, (0.0, 0.1))


def test_progress_is_told(spec):
    calls = []
    scenegen.sample(spec, {"task": (0.5, None)}, n=30_000, progress=lambda *told: calls.append(told))
    found, wanted, candidates = zip(*calls, strict=True)
    assert set(wanted) == {30_000} and list(found) == sorted(found) and found[-1] == 30_000
    assert list(candidates) == sorted(set(candidates)) and candidates[-1] >= 30_000
