"""What `scenegen view` opens, and its options."""

from __future__ import annotations

import json
import re

import pytest

import scenegen
from scenegen.cli.app import run
from scenegen.errors import DataError, RequestError, SpecError
from scenegen.show.view.export import export_page
from scenegen.show.view.project import STARTER, open_

TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"


def test_specs_folders_and_names(tmp_path, monkeypatch):
    (tmp_path / "two.spec").write_text(TEXT)
    monkeypatch.chdir(tmp_path)
    found = open_(tmp_path / "two.spec")
    assert (found.text, found.path, found.folder.root) == (TEXT, "two.spec", tmp_path.resolve())
    assert open_(tmp_path.__class__("two")).path == "two.spec"
    assert open_(tmp_path).name == STARTER and open_(None).folder.root == tmp_path.resolve()
    shipped = open_(tmp_path.__class__("sort_3"))
    assert shipped.path is None and shipped.folder.root == tmp_path.resolve()


def test_scenes_bring_their_spec_and_request(tmp_path):
    scenes = scenegen.sample(scenegen.parse(TEXT), {"task": (0, 0.1)}, 3)
    scenes.save(tmp_path / "three.jsonl")
    found = open_(tmp_path / "three.jsonl")
    assert found.scenes["poses"] == scenes.poses.tolist() and found.request["phi"] == {"task": [0.0, 0.1]}
    assert scenegen.parse(found.text).labels == ("task",)


NUMBERED = "object block[1..2] = box(5 cm, 5 cm, 5 cm), plate\nrequire noOverlap()\ntask: leftOf(block[1], plate)\n"


@pytest.fixture(scope="module")
def numbered(tmp_path_factory):
    spec = scenegen.parse(NUMBERED)
    scenes = scenegen.sample(spec, n=6)
    return scenes.save(tmp_path_factory.mktemp("numbered") / "six.parquet"), scenes


def test_scenes_of_drawn_numbers_lie_apart_by_these(numbered):
    path, scenes = numbered
    found = open_(path)
    assert [part["counts"] for part in found.parts] == [{"block": 1}, {"block": 2}]
    assert found.scenes is found.parts[-1]["scenes"] and found.request["counts"] == {"block": 2}
    assert [part["counts"] for part in found.data()["parts"]] == [{"block": 1}]
    for part in found.parts:
        mine = scenes.counts["block"] == part["counts"]["block"]
        poses = scenes.poses[mine][:, scenes.present[mine][0]]
        assert part["scenes"]["poses"] == poses.tolist() and len(poses)
        assert part["scenes"]["phi"]["task"] == scenes.phi["task"][mine].tolist()
    assert found.scenes["notes"] == [f"{len(poses)} of the {len(poses)} scenes with block[2] of six.parquet"]


def test_moments_of_pairs_are_in_no_range(tmp_path):
    spec = scenegen.parse(NUMBERED)
    scenegen.pairs(spec, {"task": (0.0, None)}, n=3).save(tmp_path / "pairs.jsonl")
    found = open_(tmp_path / "pairs.jsonl")
    phi = [phi for part in found.parts for phi in part["scenes"]["phi"]["task"]]
    assert set(found.request) == {"counts"} and len(phi) == 6 and min(phi) < 0 <= max(phi)


def test_a_file_without_scenes_is_refused(tmp_path, numbered):
    numbered[1][:0].save(tmp_path / "none.json")
    with pytest.raises(RequestError, match=r"no scenes in none.json"):
        open_(tmp_path / "none.json")


@pytest.mark.long
@pytest.mark.parametrize("what", ["spec", "scenes"])
def test_a_page_of_drawn_numbers_has_the_most_there_can_be(tmp_path, numbered, what):
    path = numbered[0]
    if what == "spec":
        path = tmp_path / "numbered.spec"
        path.write_text(NUMBERED)
    export_page(open_(path), tmp_path / "page.html", 5, 0)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    data = json.loads(re.search(r'id="data">(.*?)</script>', page)[1])
    assert [one["name"] for one in data["alone"]["spec"]["objects"]] == ["block[1]", "block[2]", "plate"]
    assert data["alone"]["spec"]["numbers"][0]["now"] == 2
    assert len(data["scenes"]["poses"]) == len(data["alone"]["reports"]) > 1


def test_what_is_not_there_is_said(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(DataError, match="sort_3"):
        open_(tmp_path.__class__("sort3"))


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["view", "nothing.spec"], "no such file"),
        (["view", "--host", "0.0.0.0"], "--public"),
        (["view", "sort_3", "--export", "page.txt"], ".html"),
        (["view", "sort_3", "--port", "70000"], "70000"),
    ],
)
def test_refusals(words, told, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert run(words) == 1
    assert told in re.sub(r"\s+", " ", capsys.readouterr().err)


def test_the_page_is_told_what_a_format_needs(tmp_path, monkeypatch):
    monkeypatch.setattr("scenegen.show.view.project.found", lambda package: package == "pxr")
    assert open_(tmp_path).data()["missing"] == {}
    monkeypatch.setattr("scenegen.show.view.project.found", lambda package: False)
    assert open_(tmp_path).data()["missing"] == {"usd": 'pip install "scenegen[usd]"'}


@pytest.mark.long
def test_a_page_is_exported(tmp_path):
    (tmp_path / "two.spec").write_text(TEXT)
    size = export_page(open_(tmp_path / "two.spec"), tmp_path / "page.html", 12, 0)
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert size == len(page.encode()) and page.count('"decides"') > 12
    again = export_page(open_(tmp_path / "two.spec"), tmp_path / "again.html", 12, 0)
    assert again == size and (tmp_path / "again.html").read_text(encoding="utf-8") == page


def test_a_spec_with_mistakes_is_not_exported(tmp_path):
    (tmp_path / "bad.spec").write_text("leftof(mug, plate)")
    with pytest.raises(SpecError):
        export_page(open_(tmp_path / "bad.spec"), tmp_path / "page.html", 3, 0)
    assert not (tmp_path / "page.html").exists()
