"""Scenes as JSON: what is written comes back bit for bit, and the files of yesterday still read."""

import json
import math
import struct
import time

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenegen.api.reading import read_scenes
from scenegen.api.sample import sample
from scenegen.api.scenes import evaluate, from_file
from scenegen.api.spec import parse
from scenegen.errors import DataError
from scenegen.scenes.data import Pose, SceneData
from scenegen.scenes.formats.scenes_json import dump, load

FLOATS = st.floats(allow_nan=False, allow_infinity=False)


@given(st.lists(st.tuples(*[FLOATS] * 7), max_size=4))
def test_floats_come_back_bit_for_bit(scenes, values):
    data = [
        SceneData(
            poses={"mug": Pose(x=a, y=b, theta=c), "plate": Pose(x=d, y=e, theta=f)},
            phi={"task": g},
        )
        for a, b, c, d, e, f, g in values
    ]
    file = scenes.header.model_copy(update={"scenes": data})
    again = load(dump(file), "x.json")
    assert again == file
    for one, other in zip(data, again.scenes, strict=True):
        assert bits(one) == bits(other)
    assert dump(again) == dump(file)


def bits(scene):
    numbers = [value for pose in scene.poses.values() for value in (pose.x, pose.y, pose.theta)]
    return struct.pack(f"{len(numbers) + 1}d", *numbers, scene.phi["task"])


def test_arrays_come_back_bit_for_bit(scenes, tmp_path):
    again = read_scenes(scenes.save(tmp_path / "x.json"))
    assert np.array_equal(again.poses, scenes.poses) and np.array_equal(again.phi["task"], scenes.phi["task"])
    assert again.header == scenes.header


def test_layout(written, scenes):
    """The header for people, then one scene a line, for grep and diff."""
    text = written.decode()
    assert json.loads(text)["format"] == "scenegen/scenes"
    assert sum(line.startswith('  {"poses": ') for line in text.splitlines()) == len(scenes)
    assert text.endswith("\n ]\n}\n")


def test_yesterdays_file_still_reads_and_scores_the_same(root):
    """tests/golden/formats/scenes.json is version 1 for good and never rewritten: people have such files."""
    old = read_scenes(root / "tests" / "golden" / "formats" / "scenes.json")
    spec = parse(old.header.spec.source)
    assert spec.checked.sha256 == old.header.spec.sha256
    phi = evaluate(spec.checked, old)["task"]
    np.testing.assert_allclose(phi, old.phi["task"], rtol=0, atol=1e-12)
    (mx, my, _), (px, py, _) = old.poses[0]
    assert abs(min(px - mx, math.dist((mx, my), (px, py)) - 0.25) - old.phi["task"][0]) < 1e-12


def test_a_byte_order_mark_does_no_harm(written):
    assert load(b"\xef\xbb\xbf" + written, "x.json") == load(written, "x.json")


def test_an_empty_set_is_a_file_too(scenes):
    empty = load(dump(scenes.header), "x.json")
    assert empty.scenes == [] and len(from_file(empty)) == 0 and from_file(empty).poses.shape == (0, 2, 3)


@pytest.mark.parametrize("ending", [".json", ".jsonl", ".parquet"])
def test_an_empty_set_keeps_its_labels(ending, tmp_path):
    made = sample(parse("object a, b\nz: leftOf(a, b)\nm: aboveOf(a, b)"), n=2)
    again = read_scenes(made[:0].save(tmp_path / f"x{ending}"))
    assert (len(again), tuple(again.phi), again.header) == (0, ("z", "m"), made.header)
    assert tuple(from_file(made[:0].file()).phi) == ("z", "m")
    other = again.save(tmp_path / "y.json")
    assert list(read_scenes(other).phi) == ["z", "m"] and json.loads(other.read_bytes())["labels"] == ["z", "m"]
    full = made.save(tmp_path / f"full{ending}").read_bytes()  # its scenes name them
    assert b'"labels"' not in full


def test_labels_beside_scenes_are_those_of_the_scenes(written, tmp_path):
    data = json.loads(written)
    for labels, good in ((["task"], True), (["task", "safe"], False), ([], False)):
        text = json.dumps({**data, "labels": labels}).encode()
        lines = [json.dumps({**data, "scenes": [], "labels": labels}).replace(', "scenes": []', "")]
        (tmp_path / "x.jsonl").write_text("\n".join([*lines, *map(json.dumps, data["scenes"])]))
        for read in (lambda: load(text, "x.json"), lambda: read_scenes(tmp_path / "x.jsonl")):  # noqa: B023
            if good:
                read()
                continue
            with pytest.raises(DataError, match="other labels"):
                read()


def test_a_key_that_stands_twice_is_found_in_no_time():
    keys = ", ".join(f'"k{number}": 0' for number in range(200_000))
    began = time.process_time()
    with pytest.raises(DataError, match="`k199999` stands twice"):
        load(f'{{{keys}, "k199999": 0}}'.encode(), "x.json")
    assert time.process_time() - began < 20.0  # 0.2 s; hours where every key is counted


@pytest.mark.parametrize(
    "text, said",
    [
        ("", "not valid JSON"),
        ("[]", 'its "format" is not'),
        ("null", 'its "format" is not'),
        ('{"format": "scenegen/scenes", "version": 3}', "version 3"),
        ('{"format": "scenegen/scenes", "version": "1"}', "version '1'"),
        ('{"format": "scenegen/scenes", "version": 1}', "damaged at `spec`"),
        ('{"format": 1, "format": "scenegen/scenes"}', "`format` stands twice"),
        ("[" * 200_000, "nested too deeply"),
        ("1" * 5000, "thousands of digits"),
    ],
)
def test_damage(text, said):
    with pytest.raises(DataError) as caught:
        load(text.encode(), "x.json")
    (problem,) = caught.value.diagnostics
    assert said in problem.title and problem.help
