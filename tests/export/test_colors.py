"""Colours that a spec gives to plain shapes: in scene files, in pictures, in simulators' files."""

import json
import re

import pytest

import scenegen
from scenegen.errors import SpecError
from scenegen.scenes.stage import stage_of
from scenegen.things.palette import rgb_of

TEXT = (
    'object sponge = box(10 cm, 6 cm, 4 cm, color = "#ffdd33"), cup[2] = cylinder(3 cm, 8 cm, color = "red"),\n'
    '    wedge = prism([(0, 0), (20 cm, 0), (0, 12 cm)], 3 cm, color = "Navy"), other = box(10 cm, 6 cm, 4 cm)\n'
    "task: leftOf(sponge, other)\n"
)
COLORS = {"sponge": "#ffdd33", "cup[1]": "#ff0000", "cup[2]": "#ff0000", "wedge": "#000080"}


@pytest.fixture(scope="module")
def scenes():
    return scenegen.sample(scenegen.parse(TEXT), n=2, seed=0)


def test_in_scene_files_and_pictures(scenes, tmp_path):
    """They survive a file, and no other object has such a field."""
    for name in ("s.json", "s.jsonl"):
        scenes.save(tmp_path / name)
        read = scenegen.read_scenes(tmp_path / name)
        assert {one.name: one.shape.color for one in read.header.objects if one.shape.color} == COLORS
        things = dict(zip(read.objects, stage_of(read.file()).things, strict=True))
        assert {name: things[name].color for name in COLORS} == {name: rgb_of(one) for name, one in COLORS.items()}
    written = json.loads((tmp_path / "s.json").read_text())["objects"]
    assert [one["name"] for one in written if "color" not in one["shape"]] == ["other"]


@pytest.mark.parametrize(("to", "ending"), [("mjcf", "xml"), ("sdf", "sdf")])
def test_in_simulators(scenes, tmp_path, to, ending):
    scenes.export(tmp_path, to)
    text = (tmp_path / f"scene_0001.{ending}").read_text()
    found = {
        tuple(round(float(one), 3) for one in numbers.split()[:3])
        for numbers in re.findall(r"[\d.]+ [\d.]+ [\d.]+ 1\b", text)
    }
    for color in COLORS.values():
        assert tuple(round(one, 3) for one in rgb_of(color)) in found


def test_the_text_keeps_them(scenes):
    spec = scenegen.parse(TEXT)
    assert scenegen.parse(spec.source).declared.shapes == spec.declared.shapes
    assert spec.declared.shapes[0].color == "#ffdd33" and spec.declared.shapes[-1].color == ""


@pytest.mark.parametrize(
    ("shape", "code"),
    [
        ('box(1 cm, 1 cm, 1 cm, color = "redd")', "unknown-choice"),
        ('cylinder(1 cm, 1 cm, color = "#12")', "unknown-choice"),
        ('cylinder(1 cm, 1 cm, color = "hsl(0, 100%, 50%)")', "unknown-choice"),
        ("box(1 cm, 1 cm, 1 cm, color = red)", "file-without-quotes"),
        ("box(1 cm, 1 cm, 1 cm, 3)", "file-without-quotes"),
        ('box(1 cm, 1 cm, 1 cm, colour = "red")', "unknown-parameter"),
        ('mesh("x.obj", box(1 cm, 1 cm, 1 cm, color = "red"))', "not-a-shape"),
    ],
)
def test_what_is_no_colour(shape, code):
    with pytest.raises(SpecError) as caught:
        scenegen.parse(f"object a = {shape}, b\ntask: leftOf(a, b)")
    assert caught.value.diagnostics[0].code == code
