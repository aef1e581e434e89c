"""What people give from Python that is of the wrong kind gets the project's own words, and before any work is done."""

import json
from pathlib import Path

import numpy as np
import pytest

import scenegen


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse("leftOf(mug, plate)")


@pytest.fixture(scope="module")
def scenes(spec):
    return scenegen.sample(spec, n=3)


@pytest.fixture(scope="module")
def model(spec, tmp_path_factory):
    out = tmp_path_factory.mktemp("model") / "m.safetensors"
    return scenegen.train(spec, "gan", recipe="paper", out=out, epochs=np.int64(1), scenes=200, lr=np.float32(1e-3))


def test_numpys_numbers_are_as_good_as_pythons(spec, tmp_path):
    found = scenegen.sample(spec, n=np.int64(3), seed=np.int32(5), timeout=np.float32(60.0))
    again = scenegen.read_scenes(found.save(tmp_path / "s.json"))
    assert (again.poses == scenegen.sample(spec, n=3, seed=5).poses).all()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"n": True}, "`n` is True"),
        ({"workers": "2"}, "`workers` is '2'"),
        ({"workers": 1.5}, "`workers` is 1.5"),
        ({"method": None}, "unknown method `None`"),
        ({"spread": 3}, "unknown spread `3`"),
        ({"phi": {0: (0.0, 0.1)}}, "no label `0`"),
        ({"fix": {0: (0.5, 0.5)}}, "no object `0`"),
        ({"fix": np.zeros(3)}, "poses by name"),
    ],
)
def test_requests(spec, options, said):
    with pytest.raises(scenegen.RequestError, match=said):
        scenegen.sample(spec, **options)


@pytest.mark.parametrize("call", [scenegen.rarity, lambda spec: scenegen.train(spec, "gan", out="never.safetensors")])
def test_a_path_is_no_spec(call):
    with pytest.raises(scenegen.RequestError, match=r"a Spec is needed here, not 'a.spec'(.|\n)*load it first"):
        call("a.spec")


@pytest.mark.long
def test_specs_and_models(model, tmp_path):
    with pytest.raises(scenegen.RequestError, match=r"scenegen.load\(FILE\) reads a file"):
        scenegen.parse(Path("a.spec"))
    with pytest.raises(scenegen.RequestError, match="`path` is None"):
        scenegen.load(None)
    with pytest.raises(scenegen.RequestError, match="a Spec is needed here"):
        scenegen.load_model(tmp_path / "m.safetensors", "a.spec")
    with pytest.raises(scenegen.RequestError, match="a Spec is needed here, not <Model gan"):
        scenegen.rarity(model)
    with pytest.raises(scenegen.RequestError, match="`seed` is '0'"):
        scenegen.rarity(model.spec, seed="0")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"epoch": 3}, "unknown option `epoch`(.|\n)*did you mean `epochs`"),
        ({"hyper": 5}, "`hyper` is 5"),
        ({"hyper": {"widht": 5}}, "no setting `widht`(.|\n)*did you mean `width`"),
        ({"data": ["a"]}, r"`data` is \['a'\]"),
        ({"epochs": True}, "`epochs` is True"),
    ],
)
def test_trainings(spec, tmp_path, options, said):
    with pytest.raises(scenegen.RequestError, match=said):
        scenegen.train(spec, "energy", out=tmp_path / "m.safetensors", **options)
    assert not list(tmp_path.iterdir())


def test_data_by_path_and_never_overwritten(spec, tmp_path):
    data = scenegen.sample(spec, n=64).save(tmp_path / "d.json")
    before = data.read_bytes()
    settings = {"recipe": "paper", "epochs": 1, "data": data}
    with pytest.raises(scenegen.OutputError, match="would overwrite what it is made from"):
        scenegen.train(spec, "gan", out=data, **settings)
    made = scenegen.train(spec, "gan", out=tmp_path / "m.safetensors", **settings)
    assert data.read_bytes() == before and made.trained.card.training["data"] == str(data)


def test_sample_to_looks_at_the_file_first(spec, model, tmp_path):
    with pytest.raises(scenegen.RequestError, match="`n` is '10'"):
        scenegen.sample_to(tmp_path / "s.json", spec, n="10")
    (tmp_path / "folder.json").mkdir()
    for out in (tmp_path / "none" / "s.json", tmp_path / "folder.json"):
        for source in (spec, model):
            with pytest.raises(scenegen.OutputError, match="cannot write"):
                scenegen.sample_to(out, source, n=3)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.json"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"size": "64x48"}, "`size` is '64x48'"),
        ({"size": (64, 48, 3)}, "width and height in pixels"),
        ({"size": (64.5, 48)}, "`width` is 64.5"),
        ({"views": "top"}, r"`views` is 'top'(.|\n)*\(\"top\",\)"),
        ({"workers": "2"}, "`workers` is '2'"),
        ({"renderer": None}, "unknown renderer `None`"),
    ],
)
def test_pictures(scenes, tmp_path, options, said):
    with pytest.raises(scenegen.RequestError, match=said):
        scenes.render(tmp_path / "p", **options)


def test_figures(scenes, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(scenegen.RequestError, match=r"after the folder(.|\n)*`sheet`"):
        scenes.figures("sheet")
    with pytest.raises(scenegen.RequestError, match="no label `0`"):
        scenes.figures("d", "topview", label=0)
    assert not list(tmp_path.iterdir())


def test_one_scene_for_a_simulator(scenes):
    with pytest.raises(scenegen.RequestError, match=r"scenes\[0\]"):
        scenegen.load_pybullet(scenes)


def test_poses_that_nobody_scored_are_saved_and_exported(scenes, tmp_path):
    text = json.loads(scenes.save(tmp_path / "s.json").read_bytes())
    for one in text["scenes"]:
        one["phi"] = {}
    (tmp_path / "plain.json").write_text(json.dumps(text))
    plain = scenegen.read_scenes(tmp_path / "plain.json")
    assert (scenegen.read_scenes(plain.save(tmp_path / "again.json")).poses == scenes.poses).all()
    assert len(plain.export(tmp_path / "worlds", to="mjcf")) == 3
