"""Names that no file can have, links that lead nowhere, half characters: one diagnostic each, wherever they stand."""

import os

import numpy as np
import pytest

import scenegen
from scenegen.cli.app import run

LONG = "a" * 300
LIMIT = 255 - len(".safetensors")  # bytes of the longest name of a file


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse("leftOf(mug, plate)")


@pytest.fixture(scope="module")
def scenes(spec):
    return scenegen.sample(spec, n=3)


CALLS = {
    "load": lambda spec, scenes, path: scenegen.load(path),
    "load_root": lambda spec, scenes, path: scenegen.load("a.spec", path),
    "load_model": lambda spec, scenes, path: scenegen.load_model(path),
    "read_scenes": lambda spec, scenes, path: scenegen.read_scenes(path + ".json"),
    "save": lambda spec, scenes, path: scenes.save(path + ".json"),
    "export": lambda spec, scenes, path: scenes.export(path, "mjcf"),
    "export_file": lambda spec, scenes, path: scenes.export(path + ".xml"),
    "render": lambda spec, scenes, path: scenes.render(path, size=(32, 32)),
    "figures": lambda spec, scenes, path: scenes.figures(path, "heatmap"),
    "sample_to": lambda spec, scenes, path: scenegen.sample_to(path + ".jsonl", spec, n=3),
    "train": lambda spec, scenes, path: scenegen.train(spec, "gan", out=path),
    "train_log": lambda spec, scenes, path: scenegen.train(spec, "gan", out="m.safetensors", log_dir=path),
    "train_data": lambda spec, scenes, path: scenegen.train(spec, "gan", out="m.safetensors", data=path + ".json"),
}


@pytest.mark.parametrize("path", ["a\0b", "a\ud800b", LONG, "loop"], ids=["nul", "half", "long", "loop"])
@pytest.mark.parametrize("call", CALLS)
def test_names_that_no_file_has(call, path, spec, scenes, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.spec").write_text("leftOf(mug, plate)")
    for ending in ("", ".json", ".jsonl", ".xml"):
        (tmp_path / f"loop{ending}").symlink_to(f"loop{ending}")
    before = sorted(tmp_path.iterdir())
    if (call, path) == ("load_root", LONG) or (call, path) == ("load_root", "loop"):
        return  # nothing is read there as long as nothing is imported
    with pytest.raises(scenegen.ScenegenError) as caught:
        CALLS[call](spec, scenes, path)
    assert len(caught.value.diagnostics) == 1 and caught.value.diagnostics[0].help
    assert sorted(tmp_path.iterdir()) == before


COMMANDS = (
    "check {}",
    "fmt {}",
    "range {}",
    "range good.spec --png {}.png",
    "sample {}",
    "sample good.spec -n 3 --out {}.json",
    "sample good.spec -n 3 --resume --out {}.parquet",
    "sample good.spec -n 3 --render {} --out s.json",
    "eval good.spec {}.json",
    "eval {} scenes.json",
    "render {}.json --out pictures",
    "render scenes.json --out {}",
    "export scenes.json --to sdf --out {}",
    "export scenes.json --out {}.jsonl",
    "export {}.json --to mjcf --out worlds",
    "train good.spec --model gan --out {}",
    "train good.spec --model gan --out m.safetensors --log-dir {}",
    "train {} --model gan --out m.safetensors",
    "train good.spec --model gan --data {}.json --out m.safetensors",
    "info {}",
)


@pytest.mark.long
@pytest.mark.parametrize("path", [LONG, "loop"], ids=["long", "loop"])
@pytest.mark.parametrize("words", COMMANDS)
def test_no_command_calls_it_a_bug(words, path, scenes, tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "good.spec").write_text("leftOf(mug, plate)")
    scenes.save("scenes.json")
    for ending in ("", ".json", ".jsonl", ".parquet", ".png"):
        (tmp_path / f"loop{ending}").symlink_to(f"loop{ending}")
    before = sorted(tmp_path.iterdir())
    assert run(words.format(path).split()) == 1
    said = capfd.readouterr().err
    assert said.startswith("error[") and "itself failed" not in said and said.count("error[") == 1, said
    assert "= help: " in said and sorted(tmp_path.iterdir()) == before


def test_a_name_as_long_as_names_can_be(spec, scenes, tmp_path):
    """What is written beside it for a while has a name of its own."""
    path = tmp_path / ("é" * ((255 - len(".json")) // 2) + ".json")
    assert len(scenegen.read_scenes(scenes.save(path))) == 3 and [*tmp_path.iterdir()] == [path]


def test_links_are_followed(scenes, tmp_path):
    (tmp_path / "there").mkdir()
    (tmp_path / "s.json").symlink_to("there/s.json")
    scenes.save(tmp_path / "s.json")
    assert (tmp_path / "s.json").is_symlink() and (tmp_path / "there" / "s.json").is_file()


@pytest.mark.parametrize("text", ["# a \ud83d title\nleftOf(a, b)", "leftOf(a, b) # \udc80", 'import "\ud800.spec"'])
def test_half_characters_in_a_spec(text):
    """They parsed, and could not be saved."""
    with pytest.raises(scenegen.SpecError, match=r"character U\+D.* cannot stand in a spec") as caught:
        scenegen.parse(text)
    assert caught.value.diagnostics[0].span is not None and str(caught.value).encode("utf-8", "backslashreplace")


@pytest.mark.parametrize(
    "index",
    [None, True, "mug", 1.0, (0, 1), ..., [[0], [1]], [[0], [1, 2]], [0.5], [True, False], np.zeros(3), slice("a"), {}],
    ids=repr,
)
def test_what_does_not_pick_scenes(index, scenes):
    with pytest.raises(scenegen.RequestError, match=r"does not pick scenes(.|\n)*a mask of 3 truth values"):
        scenes[index]


def test_what_picks_scenes(scenes):
    assert scenes[np.int64(-1)] == scenes[2]
    for index in (slice(1, None), [1, 2], np.array([1, 2]), [False, True, True], np.array([0, 1, 1], dtype=bool)):
        assert (scenes[index].poses == scenes.poses[1:]).all()
    assert len(scenes[[]]) == len(scenes[slice(0)]) == 0
    for number in (3, -4):
        with pytest.raises(IndexError):
            scenes[number]


@pytest.mark.long
def test_file_names_that_are_no_text(tmp_path):
    """Linux has them: the model file writes the spec's name with escapes, and cannot name such a file of scenes."""
    path = os.fsdecode(os.fsencode(tmp_path) + b"/\xff.spec")
    with open(path, "w") as file:  # noqa: PTH123 - not a name to make a Path of
        file.write("leftOf(mug, plate)")
    settings = {"epochs": 1, "out": tmp_path / "m.safetensors"}
    made = scenegen.train(scenegen.load(path), "gan", data="uniform", scenes=64, **settings)
    assert made.trained.card.spec.name.endswith("/\\udcff.spec")
    data = scenegen.sample(scenegen.load(path), n=20).save(path.replace(".spec", ".json"))
    with pytest.raises(scenegen.RequestError, match="a name in UTF-8"):
        scenegen.train(scenegen.load(path), "gan", data=data, **settings)
