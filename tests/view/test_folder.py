"""The files that a page may read and write."""

from __future__ import annotations

import os

import pytest

from scenegen.show.view.limits import MAX_TEXT
from scenegen.show.view.project import FileRefused, Folder, digest, shipped


@pytest.fixture
def folder(tmp_path):
    root = tmp_path / "root"
    (root / "below").mkdir(parents=True)
    (root / "a.spec").write_text("leftOf(a, b)")
    (root / "below" / "b.spec").write_text("leftOf(b, a)")
    (root / ".hidden").mkdir()
    (root / ".hidden" / "c.spec").write_text("")
    (tmp_path / "outside.spec").write_text("secret")
    (root / "folder.spec").mkdir()
    os.mkfifo(root / "pipe.spec")
    (root / "link.spec").symlink_to(tmp_path / "outside.spec")
    return Folder(root.resolve())


def test_specs_are_listed(folder):
    assert folder.specs() == ["a.spec", "link.spec", "pipe.spec", "below/b.spec"]
    assert folder.read("below/b.spec") == ("leftOf(b, a)", digest(b"leftOf(b, a)"))


@pytest.mark.parametrize(
    "path",
    ["../outside.spec", "below/../../outside.spec", "/etc/passwd", "link.spec", "a.txt", "", "a\0.spec", "x" * 2000,
     "..\\outside.spec", "~/a.spec/../../outside.spec", "nowhere.spec", "below", "folder.spec", "pipe.spec",
     "x" * 300 + ".spec", "a\u202e.spec", "a\n.spec", ".a.spec", ".below/a.spec"],
)  # fmt: skip
def test_nothing_else_is_read(folder, path):
    with pytest.raises(FileRefused) as error:
        folder.read(path)
    assert 400 <= error.value.status < 500 and len(str(error.value).split()) > 3


def test_a_file_is_saved_where_the_page_knows_what_is_there(folder):
    sha = folder.save("new.spec", "one", None)
    assert folder.read("new.spec") == ("one", sha)
    again = folder.save("new.spec", "two", sha)
    with pytest.raises(FileRefused, match="changed on the disk"):
        folder.save("new.spec", "three", sha)
    with pytest.raises(FileRefused, match="changed on the disk"):
        folder.save("a.spec", "three", None)
    assert folder.save("new.spec", "two", None) == again  # that is there already


@pytest.mark.parametrize(
    "path",
    [
        "../new.spec",
        "link.spec",
        "nowhere/new.spec",
        "a.py",
        "x" * 300 + ".spec",
        "pipe.spec",
        "a\u202e.spec",
        ".a.spec",
    ],
)
def test_nothing_else_is_written(folder, path):
    with pytest.raises(FileRefused):
        folder.save(path, "mine", None)


def test_large_texts_are_refused(folder):
    with pytest.raises(FileRefused) as error:
        folder.save("new.spec", "x" * (MAX_TEXT + 1), None)
    assert error.value.status == 413


def test_shipped_specs_have_titles():
    assert all(one["title"] and one["text"] for one in shipped())


def test_drafts_are_kept_outside_the_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    (tmp_path / "opened").mkdir()
    folder, other = Folder(tmp_path / "opened"), Folder(tmp_path)
    assert folder.draft("a.spec") is None
    folder.keep_draft("a.spec", "object mug\n", "abc")
    found = folder.draft("a.spec")
    assert found is not None and (found["text"], found["was"]) == ("object mug\n", "abc")
    assert other.draft("a.spec") is None and folder.draft("b.spec") is None
    assert list((tmp_path / "opened").iterdir()) == []
    (kept,) = (tmp_path / "state/scenegen/drafts").iterdir()
    kept.write_text("{")
    assert folder.draft("a.spec") is None
    folder.keep_draft("a.spec", None, None)
    assert not kept.exists()
    with pytest.raises(FileRefused, match="at most"):
        folder.keep_draft("a.spec", "#" * (MAX_TEXT + 1), None)
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    with pytest.raises(FileRefused, match="cannot be kept"):
        folder.keep_draft("a.spec", "object mug\n", None)
