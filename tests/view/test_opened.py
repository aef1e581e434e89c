"""What `scenegen view` opens, and its options."""

from __future__ import annotations

import re

import pytest

import scenegen
from scenegen.cli.app import run
from scenegen.errors import DataError, SpecError
from scenegen.view.export import export_page
from scenegen.view.opened import STARTER, open_

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
    monkeypatch.setattr("scenegen.view.opened.found", lambda package: package == "pxr")
    assert open_(tmp_path).data()["missing"] == {}
    monkeypatch.setattr("scenegen.view.opened.found", lambda package: False)
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
