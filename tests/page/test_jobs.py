"""What workers do for the page, in this process."""

from __future__ import annotations

import base64
import json
import os
import sys
import threading
import time
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import scenegen
from scenegen.cli.eval import as_json
from scenegen.errors import DataError, RequestError, SpecError
from scenegen.errors.program import PAGE_LIMIT
from scenegen.page.jobs import JOBS, job_of, source
from scenegen.page.limits import JOB_SECONDS
from scenegen.page.worker import dumps
from scenegen.resources import shipped_specs

TEXT = "object mug, plate\nrequire noOverlap()\ntask: leftOf(mug, plate) & closeTo(mug, plate, 30 cm)\n"


SHELVES = (
    "region board[2] = rect(0, 0.6, 1, 1) at 30 cm, 60 cm\n"
    "object can on any of board, cup on any of [board[1], workspace], mug\n"
    "require noCollision()\ntask: atLevel(can, cup)\n"
)


def do(job, tmp_path, **fields):
    message = {"job": job, "root": str(tmp_path), "path": None, "text": TEXT, **fields}
    return list(job_of(job)(message))


def test_every_job_has_a_time_limit():
    assert set(JOBS) == set(JOB_SECONDS)
    assert all(callable(job_of(name)) for name in JOBS)


def test_check_describes_a_spec_and_lists_its_problems(tmp_path):
    described, problems = do("check", tmp_path)
    spec = described["spec"]
    assert [one["name"] for one in spec["objects"]] == ["mug", "plate"]
    assert spec["requires"] and set(spec["trees"]) == {"task", "require"}
    first, second = spec["trees"]["task"]["parts"]
    assert TEXT[slice(*first["spans"][0])] == "leftOf(mug, plate)"
    assert TEXT[slice(*second["spans"][0])] == "closeTo(mug, plate, 30 cm)"
    assert problems == {"problems": []}


SEEN = (
    "robot arm = panda at (0.5, -0.25, NORTH)\nrobot other = so101 at (0.9, 0.9, WEST)\n"
    "camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 4:3\n"
    "object can, mug, bottle\nrequire noOverlap()\ntask: graspable(can, arm) & visible(mug, front, 20 %, 70 %)\n"
)


def test_check_says_what_robots_reach_and_cameras_picture(tmp_path):
    spec = do("check", tmp_path, text=SEEN)[0]["spec"]
    rings = {one["name"]: one["ring"] for one in spec["objects"]}
    assert rings["can"] is None and rings["arm"]["bearing"] is None and len(rings["other"]["bearing"]) == 2
    assert 0.05 < rings["arm"]["nearest"] < 0.1 < 0.75 < rings["arm"]["farthest"] < 0.85
    (front,) = spec["cameras"]
    assert front["name"] == "front" and front["outside"] and len(front["corners"]) > 3
    assert spec["table"][1] < -0.3  # the base beside the workspace is on the table
    assert do("check", tmp_path)[0]["spec"]["cameras"] == []


def test_evaluate_says_what_is_seen_and_where_hands_are(tmp_path):
    poses = [[[0.5, -0.25, np.pi / 2], [0.9, 0.9, np.pi], [0.3, 0.3, 0.0], [0.6, 0.5, 0.0], [0.58, 0.3, 0.0]]]
    (found,) = do("evaluate", tmp_path, text=SEEN, poses=poses, why=True)
    (seen,), (hand,) = found["seen"], found["hands"]
    assert (seen["camera"], seen["thing"]) == ("front", 3) and 0.0 < seen["share"] < 1.0
    assert seen["words"] == f"{100 * seen['share']:.0f} %"
    assert (hand["thing"], hand["robot"], len(hand["boxes"])) == (2, 0, 3) and hand["room"] > 0.0
    sight = SEEN.replace("graspable(can, arm) & ", "")
    (alone,) = do("evaluate", tmp_path, text=sight, poses=poses)
    assert 0.1 * min(seen["share"] - 0.2, 0.7 - seen["share"]) == pytest.approx(alone["phi"]["task"][0], abs=1e-9)
    assert "seen" not in do("evaluate", tmp_path, poses=[poses[0][2:4]], why=True)[0]


def test_evaluate_says_where_things_usually_are(tmp_path):
    text = "object mug, cup\nusually cup ~ normal(mug, 3 cm)\ntask: leftOf(mug, cup)"
    (found,) = do("evaluate", tmp_path, text=text, poses=[[[0.25, 0.5, 0.0], [0.75, 0.5, 0.0]]], why=True)
    (place,) = found["usual"]
    assert place["things"] == (1,) and place["discs"][0]["middle"] == (0.25, 0.5)
    assert "usual" not in do("evaluate", tmp_path, poses=[[[0.2, 0.5, 0.0], [0.6, 0.5, 0.0]]], why=True)[0]


def test_check_of_a_mistake_has_problems_alone(tmp_path):
    described, problems = do("check", tmp_path, text="leftof(mug, plate)")
    assert described == {"spec": None}
    (one,) = problems["problems"]
    assert "did you mean `leftOf`?" in one["message"] and one["range"]["end"]["character"] == 6


def test_check_names_what_clashes(tmp_path):
    _, problems = do("check", tmp_path, text="leftOf(mug, plate) & rightOf(mug, plate) & x(mug) >= x(plate) + 10 cm")
    assert "clash" in problems["problems"][0]["message"]


@pytest.mark.parametrize("name", ["chess_corner", "sort_7", "tea_party"])
def test_shipped_specs_are_described_as_json(tmp_path, name):
    text = shipped_specs()[name].read_text()
    for part in do("check", tmp_path, text=text):
        json.loads(dumps(part))


def test_evaluate_agrees_with_eval_to_the_bit(tmp_path):
    spec = scenegen.parse(TEXT)
    scenes = scenegen.sample(spec, n=4, seed=3)
    (found,) = do("evaluate", tmp_path, poses=json.loads(json.dumps(scenes.poses.tolist())), why=True)
    path = scenes.save(tmp_path / "scenes.json")
    told = as_json(spec, scenegen.read_scenes(path))["scenes"]
    assert found["phi"]["task"] == [one["phi"]["task"] for one in told]
    assert found["require"] == [one["require"] for one in told]
    task = found["decides"]["task"]
    assert task["value"] == found["phi"]["task"][0]
    assert TEXT[slice(*task["spans"][0])] == task["text"].replace("0.3", "30 cm")
    assert task["marks"] and found["values"][task["lines"][0]] == task["value"]


@pytest.mark.parametrize("poses", [None, [], [[1, 2]], [[[0, 0, "x"], [0, 0, 0]]], [[[0, 0, 1e999], [0, 0, 0]]]])
def test_poses_that_are_none_are_refused(tmp_path, poses):
    with pytest.raises(DataError):
        do("evaluate", tmp_path, poses=poses)


def test_sample_is_the_sample_of_the_package(tmp_path):
    request = {"phi": {"task": [0, 0.1]}, "n": 5, "seed": 2, "fix": {"plate": [0.5, 0.5]}}
    (found,) = do("sample", tmp_path, request=request)
    there = scenegen.sample(scenegen.parse(TEXT), {"task": (0, 0.1)}, 5, seed=2, fix={"plate": (0.5, 0.5)})
    assert found["poses"] == there.poses.tolist() and found["phi"]["task"] == there.phi["task"].tolist()
    assert len(found["bases"]) == 5


@pytest.mark.parametrize(
    "request_", [{"n": 401}, {"n": 0}, {"n": "many"}, {"phi": {"task": 3}}, {"fix": {"mug": ["left", 0]}}, {"phi": [1]}]
)
def test_requests_beyond_the_limits_are_refused(tmp_path, request_):
    with pytest.raises(RequestError):
        do("sample", tmp_path, request=request_)


@pytest.mark.parametrize(("job", "most"), [("first", 4), ("spread", 32)])
def test_the_first_look_is_in_range_and_keeps_what_is_held(tmp_path, job, most):
    held = [0.5, 0.5, 1.0]
    request = {"phi": {"task": [-0.2, 0.1]}, "n": 40, "seed": 3, "fix": {"plate": held}}
    (found,) = do(job, tmp_path, request=request)
    assert most / 2 <= len(found["poses"]) <= most
    assert all(-0.2 <= phi <= 0.1 for phi in found["phi"]["task"]) and all(one[1] == held for one in found["poses"])
    (again,) = do(job, tmp_path, request=request)
    assert again["poses"] == found["poses"]


def test_the_first_look_gives_way_quietly(tmp_path):
    text = "object a, b\ntask: leftOf(a, b)\nrequire rightOf(a, b)\n"
    assert list(do("first", tmp_path, text=text, request={"phi": {"task": [0, None]}})) == [None]


def test_the_first_look_of_a_text_that_is_not_read_yet(tmp_path):
    text = "object a, b, c, d\nrequire noOverlap()\nfirst: leftOf(a, b)\nsecond: leftOf(c, d)\n"
    request = {"phi": {"first": [0, 0.1], "gone": [2, 3]}, "n": 40, "fix": {"gone": [0, 0], "b": [0.5, 0.5]}}
    (found,) = do("first", tmp_path, text=text, request={**request, "others": [None, -0.05]})
    assert len(found["poses"]) >= 2 and all(one[1][:2] == [0.5, 0.5] for one in found["poses"])
    assert all(0 <= phi <= 0.1 for phi in found["phi"]["first"])
    assert all(phi <= -0.05 for phi in found["phi"]["second"])
    for wrong in ({"phi": 3}, {"phi": {}, "fix": 3}, {}):
        with pytest.raises(RequestError):
            do("first", tmp_path, text=text, request={**wrong, "others": [0, None]})


@pytest.mark.long
def test_thousands_of_objects_are_shown_soon(tmp_path):
    """What each pair of 2,000 objects took together was 18 s for the table, 38 s for a first look, 51 s for a scene."""
    text = "object block[2000] = box(1 cm, 1 cm, 1 cm)\ntask: leftOf(block[1], block[2])\n"
    began = time.process_time()
    described, _ = do("check", tmp_path, text=text)
    assert described["spec"]["most"] == 10
    request = {"phi": {}, "n": 16, "seed": 0}  # as many as a page asks for before it knows that it may not
    (found,) = do("first", tmp_path, text=text, request={**request, "others": [0, None]})
    assert len(found["poses"]) == 4
    (told,) = do("evaluate", tmp_path, text=text, poses=found["poses"][:1], why=True)
    assert told["overlaps"] and told["bases"][0] == found["bases"][0]
    assert time.process_time() - began < 10.0


def test_what_stands_on_one_of_several_surfaces_keeps_its_own(tmp_path):
    described, _ = do("check", tmp_path, text=SHELVES)
    spec = described["spec"]
    assert [one["surfaces"] for one in spec["objects"]] == [["board[1]", "board[2]"], ["board[1]", "workspace"], []]
    assert [one["height"] for one in spec["regions"]] == [0.3, 0.6] and spec["tall"] > 0.6
    (found,) = do("sample", tmp_path, text=SHELVES, request={"phi": {"task": [0, None]}, "n": 6, "seed": 1})
    there = scenegen.sample(scenegen.parse(SHELVES), {"task": (0, None)}, 6, seed=1)
    assert found["on"] == there.on.astype(int).tolist() and found["bases"] == there.poses7()[..., 2].tolist()
    (first,) = do("first", tmp_path, text=SHELVES, request={"phi": {"task": [0, None]}, "n": 6})
    assert all({1: 0.3, 2: 0.6}[on[0]] == bases[0] for on, bases in zip(first["on"], first["bases"], strict=True))
    told = {"text": SHELVES, "poses": found["poses"], "on": found["on"]}
    (again,) = do("evaluate", tmp_path, why=True, **told)
    assert again["phi"] == found["phi"] and again["on"] == found["on"]
    other = [[3 - one[0], one[1]] for one in found["on"]]  # the can on the other board: nothing else moves
    (moved,) = do("evaluate", tmp_path, **{**told, "on": other})
    assert [one[0] for one in moved["bases"]] == [{1: 0.3, 2: 0.6}[one[0]] for one in other]
    assert [one[1:] for one in moved["bases"]] == [one[1:] for one in found["bases"]]
    (name,) = do("download", tmp_path, format="parquet", into=str(tmp_path), **{**told, "on": other})
    back = scenegen.read_scenes(tmp_path / name)
    assert back.on.tolist() == other and back.phi["task"].tolist() == moved["phi"]["task"]


@pytest.mark.parametrize(
    "on", [None, [], [[1]], [[1, 3]], [[0, 1]], [[1.5, 1]], [["1", "x"]], [[1, 1], [1, 1]], [{}], 7]
)
def test_surfaces_that_are_none_are_refused(tmp_path, on):
    poses = [[[0.5, 0.5, 0.0]] * 3]
    with pytest.raises(DataError, match="surfaces"):
        do("evaluate", tmp_path, text=SHELVES, poses=poses, on=on)


@pytest.mark.slow
@pytest.mark.parametrize("name", shipped_specs())
def test_every_shipped_spec_works_on_the_page(tmp_path, name):
    text = shipped_specs()[name].read_text()
    spec = do("check", tmp_path, text=text)[0]["spec"]
    request = {"phi": {one["name"]: [0, None] for one in spec["labels"]}, "n": 8}
    (first,) = do("first", tmp_path, text=text, request=request)
    (found,) = do("sample", tmp_path, text=text, request=request)
    assert len(first["poses"]) >= 2 and len(found["poses"]) == 8
    for some in (first, found):
        (told,) = do("evaluate", tmp_path, text=text, poses=some["poses"], on=some["on"], why=True)
        assert told["phi"] == some["phi"] and all(phi >= 0 for values in told["phi"].values() for phi in values)
        assert told["bases"] == some["bases"] and all(base >= 0 for base in told["bases"][0])


def test_warnings_come_with_their_codes(tmp_path, monkeypatch):
    some = replace(scenegen.sample(scenegen.parse(TEXT), n=2), warnings=(PAGE_LIMIT(most=1, count=2, what="scenes"),))
    monkeypatch.setattr("scenegen.api.sample.draw_scenes", lambda *_, **__: some)
    (found,) = do("sample", tmp_path, request={"n": 2})
    assert found["warnings"] == [{"code": PAGE_LIMIT.code, "title": some.warnings[0].title}]


@pytest.mark.skipif(sys.platform != "linux", reason="threads have priorities of their own on Linux alone")
def test_work_gives_way_in_a_thread_of_its_own(monkeypatch):
    before = os.getpriority(os.PRIO_PROCESS, 0)  # other tests may have changed it
    monkeypatch.setattr(source, "_own_priority", lambda: before)
    niced = source.run_calmly(lambda: os.getpriority(os.PRIO_PROCESS, threading.get_native_id()), 2)
    assert niced == min(before + 2, 19) and os.getpriority(os.PRIO_PROCESS, 0) == before
    with pytest.raises(ZeroDivisionError):
        source.run_calmly(lambda: 1 // 0)


def test_meshes_unpack_to_the_size_of_their_object(tmp_path):
    described, part, _ = do("check", tmp_path, have=[])
    keys = [one["mesh"] for one in described["spec"]["objects"]]
    found = part["meshes"]
    assert set(found) == set(keys)
    assert set(do("check", tmp_path, have=keys[:1])[1]["meshes"]) == {keys[1]}
    assert all("meshes" not in part for part in do("check", tmp_path, have=keys))
    plate = found[described["spec"]["objects"][1]["mesh"]]
    steps = np.frombuffer(base64.b64decode(plate["position"]), "<i2").reshape(-1, 3)
    assert steps.max() * plate["scale"] == pytest.approx(0.125, abs=1e-3)
    index = np.frombuffer(base64.b64decode(plate["index"]), "<u4" if plate["wide"] else "<u2")
    assert index.max() == len(steps) - 1 and len(index) % 3 == 0


def test_range_tells_of_every_label(tmp_path):
    (found,) = do("range", tmp_path, text="leftOf(mug, plate)")
    assert found["label"] == "task" and found["reached"][0] < 0 < found["reached"][1] and found["curve"]


@pytest.mark.parametrize("format_", ["json", "jsonl", "parquet"])
def test_downloads_can_be_read_back(tmp_path, format_):
    scenes = scenegen.sample(scenegen.parse(TEXT), n=3)
    fields = {"poses": scenes.poses.tolist(), "into": str(tmp_path), "request": {"phi": {"task": [None, 1]}}}
    (name,) = do("download", tmp_path, format=format_, sampler={"method": "rejection", "seed": 0}, **fields)
    back = scenegen.read_scenes(tmp_path / name)
    assert back.poses.tolist() == scenes.poses.tolist()
    assert back.phi["task"].tolist() == scenes.phi["task"].tolist()


@pytest.mark.parametrize("format_", ["mjcf", "sdf", "usd"])
def test_simulators_get_an_archive(tmp_path, format_):
    if format_ == "usd":
        pytest.importorskip("pxr")
    scenes = scenegen.sample(scenegen.parse(TEXT), n=2)
    (name,) = do("download", tmp_path, format=format_, poses=scenes.poses.tolist(), into=str(tmp_path))
    names = zipfile.ZipFile(tmp_path / name).namelist()
    assert sum("scene_" in one for one in names) == 2 and any("meshes/" in one for one in names)


def test_an_unknown_format_is_refused(tmp_path):
    with pytest.raises(RequestError, match="unknown format"):
        do("download", tmp_path, format="exe", poses=[[[0, 0, 0], [0, 0, 0]]], into=str(tmp_path))


@pytest.mark.parametrize("feature", ["hover", "completion", "definition", "formatting", "symbols"])
def test_the_editor_has_the_features_of_the_language_server(tmp_path, feature):
    text = "def near(a, b) = closeTo(a, b, 10 cm)\nobject mug,plate\ntask: near(mug, plate)\n"
    (found,) = do("assist", tmp_path, text=text, feature=feature, line=2, character=7)
    assert found


def test_a_definition_names_what_the_page_can_open(tmp_path):
    (tmp_path / "own.spec").write_text("# ours\nconst OWN = 3 cm\n")
    text = 'import "own.spec"\nobject mug, plate\ntask: closeTo(mug, plate, OWN)\n'
    ask = {"text": text, "feature": "definition", "line": 2}
    (found,) = do("assist", tmp_path, **ask, character=28)
    assert (found["path"], found["prelude"], found["range"]["start"]["line"]) == ("own.spec", False, 1)
    (found,) = do("assist", tmp_path, **ask, character=8)
    assert (found["path"], found["prelude"]) == (None, True)
    (found,) = do("assist", tmp_path, **ask, character=15)
    assert found["path"] == "untitled.spec"


def test_imports_stay_inside_the_folder(tmp_path):
    inner = tmp_path / "inner"
    inner.mkdir()
    (tmp_path / "secret.spec").write_text("const SECRET = 3\n")
    (inner / "own.spec").write_text("const OWN = 3 cm\n")
    text = 'import "own.spec"\nobject mug\ntask: x(mug) >= OWN\n'
    assert do("check", inner, text=text)[0]["spec"] is not None
    for path in ("../secret.spec", str(tmp_path / "secret.spec")):
        with pytest.raises(SpecError):
            do("sample", inner, text=text.replace("own.spec", path), request={"n": 1})
    (inner / "link.spec").symlink_to(tmp_path / "secret.spec")
    assert do("check", inner, text=text.replace("own.spec", "link.spec"))[0]["spec"] is None


@pytest.mark.long
def test_large_formulas_are_folded_and_cut(tmp_path):
    text = "object block[40]\nrequire noOverlap()\ntask: forall i in 1..39: leftOf(block[i], block[i+1])\n"
    described, _ = do("check", tmp_path, text=text)
    assert len(dumps(described)) < 100_000
    assert Path(tmp_path).is_dir()


def test_numbers_that_a_spec_draws_are_fixed_for_the_page(tmp_path):
    text = "object block[2..4] = box(5 cm, 5 cm, 5 cm)\nobject mug\ntask: leftOf(block[1], mug)\n"
    for counts, wanted in (({}, 4), ({"block": 3}, 3), ({"block": 9}, 4), ({"gone": 2}, 4)):
        described, _ = do("check", tmp_path, text=text, counts=counts)
        assert described["spec"]["numbers"] == [{"name": "block", "least": 2, "most": 4, "now": wanted, "assets": []}]
        assert len(described["spec"]["objects"]) == wanted + 1
        (start, end), *_ = described["spec"]["trees"]["task"]["spans"]
        assert text[start:end] == "leftOf(block[1], mug)"  # it points into what was written
        asked = {"text": text, "counts": counts, "request": {"phi": {"task": [0, None]}, "n": 2}}
        (found,) = do("sample", tmp_path, **asked)
        same = scenegen.sample(
            scenegen.parse(text).with_counts({"block": wanted}), phi={"task": (0, None)}, n=2, seed=0
        )
        assert np.array_equal(found["poses"], same.poses)
    with pytest.raises(DataError):
        do("sample", tmp_path, text=text, counts={"block": "3"}, request={"n": 1})


def test_assets_that_a_spec_draws_are_fixed_for_the_page(tmp_path):
    kinds = 'asset("red", box(0.1, 0.06, 0.2)), asset("blue", cylinder(0.04, 0.1))'
    text = f'object mug of category("mug", [{kinds}]), plate\ntask: leftOf(mug, plate)\n'
    described, _ = do("check", tmp_path, text=text)
    (one,) = described["spec"]["numbers"]
    assert one["now"] == one["most"] and one["assets"] == ["red", "blue"]
    other, _ = do("check", tmp_path, text=text, counts={"mug": 1})
    shown = [each["spec"]["objects"][0] for each in (described, other)]
    assert [each["name"] for each in shown] == ["mug:blue", "mug:red"]
    assert described["spec"]["sha256"] != other["spec"]["sha256"]


def test_problems_name_the_file_without_the_folder(tmp_path):
    _, found = do("check", tmp_path, text="")
    assert found["problems"][0]["message"].startswith("untitled.spec is empty")
    assert str(tmp_path) not in found["problems"][0]["message"]


@pytest.mark.parametrize(("name", "label"), [("tidy_desk", "tidy"), ("block_tower", "straight")])
def test_what_is_the_same_in_every_scene_does_not_explain_it(tmp_path, name, label):
    """`stackedOn` asks for a height, which is that of the stand that the spec declares."""
    text = shipped_specs()[name].read_text()
    spec = scenegen.parse(text, name)
    scenes = scenegen.sample(spec, dict.fromkeys(spec.labels, (0, None)), 4, seed=1)
    on = None if scenes.on is None else scenes.on[:1].tolist()
    (found,) = do("evaluate", tmp_path, text=text, poses=scenes.poses[:1].tolist(), on=on, why=True)
    one = found["decides"][label]
    assert found["phi"][label][0] == pytest.approx(0.001)  # the constant's margin
    assert one["text"].startswith("dist(") and one["value"] > 0.001 and one["marks"]
    told = as_json(spec, scenes, explain=True)["scenes"]
    assert all("0 <= 0.001" not in row["decided_by"].values() for row in told)


CUPS = (
    "region board[2] = rect(0, 0.6, 1, 1) at 30 cm, 60 cm\nobject can on any of board, cup on any of board\n"
    "near: closeTo(can, cup, 40 cm) & atLevel(can, cup)\nlevel: atLevel(can, cup)\n"
    "apart: gap(can, cup) >= 20 cm | abs(z(can) - z(cup)) >= 10 cm\n"
)


def test_what_depends_on_surfaces_alone_explains_phi_where_it_is_not_met(tmp_path):
    """phi of `near` is at most the tolerance of `atLevel`, wherever the two stand on one board."""
    poses = [[0.4, 0.8, 0.0], [0.6, 0.8, 0.0]]
    told = {}
    for on in ([1, 1], [1, 2]):
        (found,) = do("evaluate", tmp_path, text=CUPS, poses=[poses], on=[on], why=True)
        told[on[1]] = found["phi"], found["decides"]
    phi, decides = told[1]
    assert phi["near"] == phi["level"] == [0.001]
    near = decides["near"]
    assert (near["text"], near["value"], near["settled"]) == ("closeTo(can, cup, 0.4)", pytest.approx(0.2), False)
    assert near["keeper"]["text"] == "atLevel(can, cup, 0.001)" and near["keeper"]["value"] == 0.001
    assert (decides["level"]["text"], decides["level"]["settled"]) == ("atLevel(can, cup, 0.001)", True)
    assert "keeper" not in decides["level"]
    phi, decides = told[2]  # on two boards: what is wrong is what must change
    assert phi["near"] == [pytest.approx(-0.299)] and decides["near"]["text"] == "atLevel(can, cup, 0.001)"
    assert decides["near"]["settled"] and "keeper" not in decides["near"]
    # as one of several it lifts phi, and nothing else is to blame
    assert decides["apart"]["value"] == phi["apart"][0] == pytest.approx(0.2) and decides["apart"]["settled"]


@pytest.mark.parametrize(
    "request_",
    [
        {"phi": {"task": {}}},
        {"phi": {"task": []}},
        {"phi": {"task": [{}, 1]}},
        {"fix": {"mug": 1}},
        {"n": "x"},
        {"phi": 1},
    ],
)
@pytest.mark.parametrize("job", ["sample", "first", "spread"])
def test_what_is_no_request_is_refused_in_words(job, request_, tmp_path):
    with pytest.raises(RequestError, match="no request for scenes"):
        do(job, tmp_path, request=request_)


def test_scenes_that_only_touch_the_border_come_with_a_warning(tmp_path):
    text = "object mug, plate\ntask: leftOf(mug, plate) & rightOf(mug, plate)\n"
    (found,) = do("sample", tmp_path, text=text, request={"phi": {"task": [0, None]}, "n": 2})
    (warning,) = [one for one in found["warnings"] if one["code"] == "never-satisfied"]
    assert "`task` is satisfied only at its border" in warning["title"] and max(found["phi"]["task"]) < 1e-9
    (found,) = do("sample", tmp_path, request={"phi": {"task": [0, None]}, "n": 2})
    assert found["warnings"] == []
