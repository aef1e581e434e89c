"""Specs by name: those that ship, those in the current folder, and one to start from."""

import json

import pytest


def test_every_shipped_spec_is_listed_with_a_line(scenegen, root):
    lines = scenegen("specs").out.splitlines()
    names = [path.stem for path in sorted((root / "specs").glob("*.spec"))]
    assert [line.split()[0] for line in lines] == names
    assert all(len(line.split(maxsplit=1)[1]) > 20 for line in lines)


def test_the_text_of_one(scenegen, root):
    assert scenegen("specs", "first").out == (root / "specs" / "first.spec").read_text()


def test_a_name_that_none_has(refused):
    assert "did you mean `first`" in refused("specs", "frist")


def test_a_shipped_spec_by_its_name(scenegen, here):
    outcome = scenegen("check", "table_setting")
    assert outcome.status == 0 and outcome.out.startswith("table_setting: ok\n  A table set for one")
    outcome = scenegen("sample", "first", "--phi", "0:0.2", "-n", "2", "--out", "s.json")
    assert outcome.status == 0
    assert scenegen("eval", "first", "s.json", "--json").status == 0


@pytest.mark.parametrize("name", ["first", "first.spec"])
def test_a_file_of_that_name_comes_first(scenegen, here, name):
    (here / name).write_text("# my own\ntask: leftOf(fork, spoon)\n")
    assert "my own" in scenegen("check", "first").out


def test_an_ending_may_be_left_out(scenegen, here):
    assert scenegen("check", "good").out.startswith("good.spec: ok\n")


def test_a_name_of_nothing(refused):
    said = refused("check", "table_seting")
    assert "no file table_seting, nor table_seting.spec" in said and "did you mean `table_setting`, which ships" in said
    assert "`scenegen specs` lists" in refused("range", "nothing_like_it")


def test_no_shipped_spec_is_rewritten(refused, root):
    assert "cannot read first" in refused("fmt", "first")


def test_new_writes_a_spec_that_works(scenegen, here):
    outcome = scenegen("new", "mine")
    assert (outcome.status, outcome.out) == (0, "") and "scenegen check mine.spec" in outcome.err
    text = (here / "mine.spec").read_text()
    assert text.count("#") >= 8
    outcome = scenegen("check", "mine.spec")
    assert (outcome.status, outcome.err) == (0, "")
    assert scenegen("fmt", "--check", "mine.spec").status == 0, "it is in canonical form"
    outcome = scenegen("sample", "mine.spec", "--satisfied", "-n", "4", "--out", "s.json")
    assert outcome.status == 0 and len(json.loads((here / "s.json").read_text())["scenes"]) == 4


@pytest.mark.parametrize("name", ["good", "good.spec", "dangling"])
def test_new_overwrites_nothing(refused, here, name):
    (here / "dangling.spec").symlink_to(here / "elsewhere")
    assert "is there already" in refused("new", name)


def test_new_where_there_is_no_folder(refused):
    assert "cannot write nowhere/mine.spec" in refused("new", "nowhere/mine")
