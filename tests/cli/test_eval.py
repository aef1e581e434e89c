"""`scenegen eval`: phi of given scenes, with every digit in a pipe, beside what the file says."""

import csv
import io
import json
import math

import pytest


@pytest.fixture
def scenes(scenegen, here):
    words = ["--phi", "task=-0.3:0.3", "--phi", "safe=:0.2", "-n", "40", "--out", "s.json"]
    assert scenegen("sample", "two.spec", *words).status == 0
    return json.loads((here / "s.json").read_text())["scenes"]


def test_a_table_for_programs(scenegen, scenes):
    outcome = scenegen("eval", "two.spec", "s.json")
    assert (outcome.status, outcome.err) == (0, "")
    rows = list(csv.DictReader(io.StringIO(outcome.out), delimiter="\t"))
    assert [int(row["scene"]) for row in rows] == list(range(1, 41))
    for row, scene in zip(rows, scenes, strict=True):
        mug, plate = scene["poses"]["mug"], scene["poses"]["plate"]
        task = min(plate["x"] - mug["x"], mug["y"] - plate["y"])
        safe = math.dist((mug["x"], mug["y"]), (plate["x"], plate["y"])) - 0.25
        for name, value in (("task", task), ("safe", safe)):
            assert abs(float(row[name]) - scene["phi"][name]) <= 1e-9
            assert abs(float(row[name]) - value) <= 1e-12
            assert row[name] == repr(float(row[name]))


def test_which_atom_decides(scenegen, scenes):
    rows = list(csv.DictReader(io.StringIO(scenegen("eval", "two.spec", "s.json", "--explain").out), delimiter="\t"))
    for row, scene in zip(rows, scenes, strict=True):
        mug, plate = scene["poses"]["mug"], scene["poses"]["plate"]
        left, above = plate["x"] - mug["x"], mug["y"] - plate["y"]
        expected = "leftOf(mug, plate)" if left < above else "aboveOf(mug, plate)"
        assert row["task is decided by"] == expected
        assert row["safe is decided by"] == "!closeTo(mug, plate, 0.25)"
    assert {row["task is decided by"] for row in rows} == {"leftOf(mug, plate)", "aboveOf(mug, plate)"}


def test_scenes_of_another_spec_of_the_same_objects(scenegen, scenes, here):
    outcome = scenegen("eval", "good.spec", "s.json")
    assert outcome.status == 0
    assert outcome.out.startswith("scene\ttask\n1\t")
    assert outcome.err == "note: s.json was made from another spec; its stored phi was not compared\n"


def test_objects_may_stand_in_another_order(scenegen, scenes, here):
    first = scenegen("eval", "two.spec", "s.json").out
    data = json.loads((here / "s.json").read_text())
    data["objects"].reverse()
    for scene in data["scenes"]:
        scene["poses"] = dict(reversed(scene["poses"].items()))
    (here / "s.json").write_text(json.dumps(data))
    assert scenegen("eval", "two.spec", "s.json").out == first


def test_a_rounded_table_for_people(scenegen, scenes, monkeypatch):
    monkeypatch.setattr("scenegen.cli.eval.sys.stdout.isatty", lambda: True, raising=False)
    outcome = scenegen("eval", "two.spec", "s.json")
    assert outcome.status == 0
    header, first = (line.split() for line in outcome.out.splitlines()[:2])
    assert header == ["scene", "task", "safe"]
    assert first == ["1", *(f"{scenes[0]['phi'][name]:+.6f}" for name in ("task", "safe"))]
