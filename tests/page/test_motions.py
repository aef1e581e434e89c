"""Motions on the page: what workers say of them, files of them that are opened, pages without a server."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import scenegen
from scenegen.api.monitor import score_trajectory
from scenegen.api.motions import draw_motions
from scenegen.errors import DataError, RequestError, ScenegenError
from scenegen.errors.requests import NO_TIME_TO_TELL
from scenegen.page import export
from scenegen.page.jobs import job_of
from scenegen.page.limits import MAX_MOTION, MAX_PLAYED
from scenegen.page.project import open_
from scenegen.page.worker import dumps

TEXT = """object mug, plate, knife
time [0, 5 s] every 0.5 s
require forall a in objects: speed(a) <= 40 cm/s
require noOverlap()
task: (initially leftOf(mug, plate)) & (finally rightOf(mug, plate))
careful: always closeTo(mug, plate, 90 cm)
order: still(plate) until[0, 2.5 s] rightOf(mug, plate)
odd: !(still(plate) until_with[1, 4] rightOf(mug, plate)) | (exists a in objects: next always[0, 2] moved(a))
"""


NEAR = """object mug, plate
time [0, 4 s] every 0.5 s
require speed(mug) <= 20 cm/s & speed(plate) <= 20 cm/s
task: (always closeTo(mug, plate, 20 cm)) & (finally rightOf(mug, plate))
"""


def do(job, tmp_path, text=TEXT, **fields):
    return list(job_of(job)({"job": job, "root": str(tmp_path), "path": None, "text": text, **fields}))


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse(TEXT)


@pytest.fixture(scope="module")
def motions(spec):
    return scenegen.sample_motions(spec, n=6, seed=4)


@pytest.mark.parametrize("path", sorted((Path(__file__).resolve().parents[2] / "examples" / "motions").glob("*.spec")))
def test_the_trees_of_the_examples(path, tmp_path):
    described, problems = do("check", tmp_path, text=path.read_text())
    assert described["spec"]["trees"].keys() >= {"task"} and problems == {"problems": []}


def test_check_says_how_long_motions_last(tmp_path):
    described, problems = do("check", tmp_path)
    found = described["spec"]
    assert found["time"] == {"steps": 10, "dt": 0.5, "moves": "one"} and found["most"] == 400
    assert set(found["trees"]) == {"task", "careful", "order", "odd", "require"} and problems == {"problems": []}
    task = found["trees"]["task"]
    assert [one["text"] for one in task["parts"]] == ["initially", "finally"]
    atom = task["parts"][0]["parts"][0]
    assert TEXT[slice(*atom["spans"][0])] == "leftOf(mug, plate)"
    dumps(described)
    static, _ = do("check", tmp_path, text="object mug, plate\ntask: leftOf(mug, plate)")
    assert static["spec"]["time"] is None


def test_motions_are_those_of_sample(tmp_path, spec):
    (found,) = do("sample", tmp_path, request={"phi": {"careful": [0.1, 0.3]}, "n": 4, "seed": 3})
    same = scenegen.sample_motions(spec, {"careful": (0.1, 0.3)}, 4, seed=3)
    assert np.array_equal(found["motions"], same.poses)
    assert found["phi"] == {name: values.tolist() for name, values in same.phi.items()}
    assert do("first", tmp_path, request={}) == [None] and do("spread", tmp_path, request={}) == [None]


def lines(tree):
    yield tree
    for part in tree["parts"]:
        yield from lines(part)


def test_a_line_has_the_value_of_a_line_below_it_at_the_moment_where_that_counts(tmp_path, spec, motions):
    described, _ = do("check", tmp_path)
    for motion in motions.poses:
        (found,) = do("evaluate", tmp_path, poses=[motion.tolist()], why=True)
        scored = score_trajectory(spec, motion)
        values, at, over = found["values"], found["at"], np.array(found["over"])
        for label, tree in described["spec"]["trees"].items():
            phi = found["phi"][label][0] if label != "require" else found["require"][0]
            assert values[tree["line"]] == phi == found["decides"][label]["value"]
            atom, moment = scored.decides(None if label == "require" else label)
            decides = found["decides"][label]
            assert (decides["text"], decides["moment"]) == (atom.text, moment)
            assert decides["signal"][moment] == phi and found["signals"][label][at[tree["line"]]] == phi
            for line in lines(tree):
                number = line["line"]
                assert over[number, at[number]] == pytest.approx(values[number], rel=1e-5, abs=1e-12)
                if line["parts"]:
                    assert values[number] in [values[part["line"]] for part in line["parts"]]


def test_a_moved_object_changes_phi_of_the_whole(tmp_path, motions):
    motion = motions.poses[0].copy()
    motion[5, 0] = (0.02, 0.02, 0.0)
    (before,), (after,) = (do("evaluate", tmp_path, poses=[one.tolist()]) for one in (motions.poses[0], motion))
    assert after["require"][0] < 0.0 <= before["require"][0]  # the mug is too fast


@pytest.mark.parametrize(
    "poses", [[], "x", [[[1]]], [[[[0.1, 0.2, 0.3]] * 3] * 4], [[[["a", 1, 2]] * 3] * 11], [[[[1e999] * 3] * 3] * 11]]
)
def test_what_is_no_motion_is_refused(poses, tmp_path):
    with pytest.raises((DataError, RequestError)):
        do("evaluate", tmp_path, poses=poses)


@pytest.mark.parametrize(
    ("text", "fields", "code"),
    [
        (TEXT, {"n": 0}, "page-limit"),
        (TEXT, {"n": 401}, "page-limit"),
        (TEXT, {"method": "growth"}, "unknown-choice"),
        (TEXT, {"phi": {"tusk": [0, 1]}}, "unknown-label"),
        (TEXT.replace("require forall a in objects: speed(a) <= 40 cm/s\n", ""), {}, "no-bound-on-steps"),
        (TEXT.replace("[0, 5 s]", "[0, 3000 s]"), {}, "page-limit"),
    ],
)
def test_requests_that_cannot_be(text, fields, code, tmp_path):
    with pytest.raises(ScenegenError) as error:
        do("sample", tmp_path, text=text, request={"n": 1, **fields})
    assert error.value.diagnostics[0].code == code


def test_motions_of_a_page_as_files(tmp_path, motions):
    for format_ in ("json", "jsonl", "parquet"):
        (name,) = do("download", tmp_path, format=format_, poses=motions.poses.tolist(), into=str(tmp_path),
                     request={"n": 6}, sampler={"method": "rejection"})  # fmt: skip
        found = scenegen.read_motions(tmp_path / name)
        assert np.array_equal(found.poses, motions.poses)
        assert found.phi["task"].tolist() == motions.phi["task"].tolist()
        assert found.facts["way"].tolist() == motions.facts["way"].tolist()
    with pytest.raises(RequestError, match="unknown format `mjcf`"):
        do("download", tmp_path, format="mjcf", poses=motions.poses.tolist(), into=str(tmp_path), request={"n": 6})


def test_a_long_motion_is_not_drawn(tmp_path):
    text = TEXT.replace("[0, 5 s]", f"[0, {MAX_PLAYED / 2} s]")
    poses = [[[[0.2, 0.2, 0.0], [0.5, 0.5, 0.0], [0.8, 0.8, 0.0]]] * (MAX_PLAYED + 1)]
    with pytest.raises(RequestError) as error:
        do("download", tmp_path, text=text, format="gif", poses=poses, into=str(tmp_path), request={"n": 1})
    assert error.value.diagnostics[0].code == "page-limit"


@pytest.mark.long
def test_a_motion_is_drawn(tmp_path):
    text = "object mug\ntime 2 steps\nrequire speed(mug) <= 10 cm/s\ntask: eventually leftOf(mug, (0.5, 0.5))\n"
    poses = [[[[0.2 + 0.05 * t, 0.3, 0.0]] for t in range(3)]]
    (name,) = do("download", tmp_path, text=text, format="gif", poses=poses, into=str(tmp_path), request={"n": 1})
    with Image.open(tmp_path / name) as image:
        assert (image.format, image.n_frames) == ("GIF", 3)


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet"])
def test_a_file_of_motions_is_opened(ending, motions, tmp_path):
    path = motions.save(tmp_path / f"motions.{ending}")
    opened = open_(path)
    assert np.array_equal(opened.scenes["motions"], motions.poses) and opened.request["n"] == 6
    assert opened.scenes["phi"]["order"] == motions.phi["order"].tolist()
    assert opened.scenes["notes"] == [f"6 of the 6 motions of motions.{ending}"]


def test_a_file_whose_motions_are_not_of_its_spec(motions, tmp_path):
    path = motions.save(tmp_path / "motions.json")
    data = json.loads(path.read_text())
    data["time"]["steps"] = 9
    for one in data["motions"]:
        one["poses"] = {name: points[:10] for name, points in one["poses"].items()}
    path.write_text(json.dumps(data))
    with pytest.raises(DataError, match="its motions are not those of its spec"):
        open_(path)


def test_the_moments_of_pairs_are_scenes(tmp_path):
    pairs = scenegen.pairs(scenegen.parse("leftOf(mug, plate)"), n=3, seed=1)
    opened = open_(pairs.save(tmp_path / "pairs.jsonl"))
    assert len(opened.scenes["poses"]) == 6 and "motions" not in opened.scenes


def test_a_page_without_a_server_plays(tmp_path, motions, monkeypatch):
    from types import SimpleNamespace

    one = SimpleNamespace(label="task", bounds=(-1.0, 1.0), reached=(-0.5, 0.5), curve=(), bands=(), whole=(True, True))
    monkeypatch.setattr(
        export, "rarity", lambda spec: SimpleNamespace(labels=(one,))
    )  # tests/sampling/motions/test_sampling.py
    export.export_page(open_(motions.save(tmp_path / "motions.json")), tmp_path / "page.html", 200, 0)
    page = (tmp_path / "page.html").read_text()
    data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])
    assert np.allclose(data["scenes"]["motions"], motions.poses, atol=1e-5)
    reports = data["alone"]["reports"]
    assert len(reports) == 6 and reports[0]["over"] is None and len(reports[0]["signals"]["task"]) == 11
    assert data["alone"]["spec"]["time"]["steps"] == 10
    with pytest.raises(RequestError):
        export.export_page(open_(tmp_path / "motions.json"), tmp_path / "page.txt", 200, 0)


def test_a_motion_travels_in_one_message():
    from scenegen.page.limits import MAX_MESSAGE, MAX_TEXT

    pose = [-0.12345678901234567, 0.12345678901234567, 6.123456789012345]
    assert len(dumps([pose] * MAX_MOTION)) + MAX_TEXT < MAX_MESSAGE


@pytest.mark.long
def test_motions_are_shown_while_they_are_found(tmp_path, monkeypatch):
    """At first any, then what comes nearer, then those in the range as they are found; the last answer is as ever."""
    monkeypatch.setattr("scenegen.page.jobs.sample.BEAT_SECONDS", 0.0)
    wanted = {"phi": {"task": [0.02, None]}, "n": 6, "seed": 3, "method": "splitting"}
    *looks, last = do("sample", tmp_path, NEAR, request=wanted, watch=True)
    spec = scenegen.parse(NEAR)
    exact = scenegen.sample_motions(spec, {"task": (0.02, None)}, 6, seed=3, method="splitting")
    assert last["motions"] == exact.poses.tolist() and "look" not in last
    assert len(looks) > 2 and looks[0]["hits"] == 0 and looks[-1]["hits"] == 6
    for one in looks:
        phi = one["look"]["phi"]["task"]
        assert np.shape(one["look"]["motions"])[1:] == (9, 2, 3) and len(phi) <= 6 and 0 <= one["left"] <= 45
        assert all(value >= 0.02 for value in phi[: one["hits"]])
    assert [one["hits"] for one in looks] == sorted(one["hits"] for one in looks)
    dumps(looks)


def test_motions_that_were_found_when_time_is_up_are_shown(tmp_path, monkeypatch):
    monkeypatch.setattr("scenegen.page.jobs.sample.BEAT_SECONDS", 0.0)

    def slow(spec, request, watch):
        found = draw_motions(spec, replace(request, n=5), watch=None)
        watch(found.poses, 2)
        raise RequestError(NO_TIME_TO_TELL(tried="levels of motions", undecided=1, count=1))

    monkeypatch.setattr("scenegen.api.motions.draw_motions", slow)
    wanted = {"phi": {"task": [0, None]}, "n": 12, "method": "splitting"}
    *_, last = do("sample", tmp_path, NEAR, request=wanted, watch=True)
    assert len(last["motions"]) == 2 and min(last["phi"]["task"]) >= 0
    (warning,) = last["warnings"]
    assert "2" in warning["title"] and "12" in warning["title"]


def test_what_moves_without_a_bound_is_a_problem_at_its_declaration(tmp_path):
    text = "object mug, plate\ntime [0, 2 s] every 0.5 s\nrequire speed(plate) <= 20 cm/s\n"
    text += "task: finally leftOf(mug, plate)\n"
    described, problems = do("check", tmp_path, text)
    assert described["spec"]["time"]
    (one,) = problems["problems"]
    assert one["code"] == "no-bound-on-steps" and "write `require speed(mug) <= 20 cm/s`" in one["message"]
    assert one["range"] == {"start": {"line": 0, "character": 7}, "end": {"line": 0, "character": 10}}
