"""The files that a page may read and write. What `scenegen view` opens, and its options. Models on the page: which one
draws the scenes of a message. The examples of the page's first screen. Errors on the page name its own fields; what
has none is an option of the command.
"""

from __future__ import annotations

import json
import os
import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

import scenegen
from scenegen.cli.app import run
from scenegen.cli.output import flag
from scenegen.errors import DataError, RequestError, SpecError
from scenegen.errors.requests import NO_TIME_TO_CHECK
from scenegen.page.export import export_page
from scenegen.page.jobs import sample
from scenegen.page.jobs.source import refusal, spec_of
from scenegen.page.limits import FIELDS, MAX_TEXT, control, without_command_line
from scenegen.page.project import FIRST_SPEC, STATIC, FileRefused, Folder, digest, open_, shipped_json
from scenegen.resources import shipped_specs
from scenegen.sampling.methods import METHODS
from scenegen.worlds.exporting import EXPORTS


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
    (folder.root / "new.spec").unlink()
    assert folder.save("new.spec", "three", sha) == digest(b"three")  # nothing is there that could be lost


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
    assert all(one["title"] and one["text"] for one in shipped_json())


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


def test_each_tab_has_a_draft_and_those_of_open_tabs_stay_there(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    folder = Folder(tmp_path / "opened")
    folder.root.mkdir()
    for number, tab in enumerate(("one", "two")):
        folder.keep_draft("a.spec", f"# {tab}", None, tab)
        for file in (tmp_path / "state/scenegen/drafts").glob(f"*-{tab}.json"):
            os.utime(file, (number, number))
    assert folder.draft("a.spec")["tab"] == "two" and folder.draft("a.spec", ["two"])["text"] == "# one"
    assert folder.draft("a.spec", ["one", "two"]) is None
    folder.keep_draft("a.spec", None, None, "one")
    assert folder.draft("a.spec", ["two"]) is None and folder.draft("a.spec")["text"] == "# two"
    # what no file has is listed, once its tab is closed
    folder.keep_draft("scene", "# three", None, "three")
    assert folder.lost_drafts(["three"]) == ["a.spec"] and folder.lost_drafts(["two"]) == ["scene"]
    (folder.root / "a.spec").write_text("")
    assert folder.lost_drafts([]) == ["scene"] and Folder(tmp_path).lost_drafts([]) == []


TEXT = "object mug, plate\ntask: leftOf(mug, plate)\n"


def test_a_file_is_read_again_for_each_page(tmp_path):
    (tmp_path / "two.spec").write_text(TEXT)
    found = open_(tmp_path / "two.spec")
    (tmp_path / "two.spec").write_text(TEXT + "# more")
    now = found.now().data()
    assert (now["text"], now["sha"]) == (TEXT + "# more", digest((TEXT + "# more").encode()))
    (tmp_path / "two.spec").unlink()
    assert (found.now().text, found.now().digest) == (TEXT, None)


def test_commands_find_an_example_by_its_name_and_a_file_by_its_folder(tmp_path, monkeypatch):
    (tmp_path / "below").mkdir()
    (tmp_path / "below" / "two.spec").write_text(TEXT)
    scenegen.sample(scenegen.parse(TEXT), n=1).save(tmp_path / "first.json")
    monkeypatch.chdir(tmp_path)
    told = {name: open_(Path(name)).data() for name in ("sort_3", "first.json", "below/two.spec")}
    assert [one["shipped"] for one in told.values()] == ["sort_3", None, None]
    assert [one["where"] for one in told.values()] == [".", ".", "below"]


def test_specs_folders_and_names(tmp_path, monkeypatch):
    (tmp_path / "two.spec").write_text(TEXT)
    monkeypatch.chdir(tmp_path)
    found = open_(tmp_path / "two.spec")
    assert (found.text, found.path, found.folder.root) == (TEXT, "two.spec", tmp_path.resolve())
    assert open_(tmp_path.__class__("two")).path == "two.spec"
    assert open_(tmp_path).name == FIRST_SPEC and open_(None).folder.root == tmp_path.resolve()
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


def test_starts_and_goals_lie_together_and_what_is_left_out_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr("scenegen.page.project.most_scenes", lambda objects: 5)  # two pairs, and half of another
    scenegen.pairs(scenegen.parse(TEXT), {"task": (0.0, None)}, n=3).save(tmp_path / "pairs.jsonl")
    found = open_(tmp_path / "pairs.jsonl").scenes
    phi = found["phi"]["task"]
    assert found["together"] == 2 and len(phi) == 4 and max(phi[::2]) < 0.0 <= min(phi[1::2])
    assert [one["title"] for one in found["warnings"]] == ["the first 4 of the 6 scenes of pairs.jsonl"]
    scenegen.sample(scenegen.parse(TEXT), n=7).save(tmp_path / "seven.json")
    found = open_(tmp_path / "seven.json").scenes
    assert found["together"] == 1 and len(found["poses"]) == 5
    assert [one["title"] for one in found["warnings"]] == ["the first 5 of the 7 scenes of seven.json"]
    moving = scenegen.parse(
        "object mug, plate\ntime 2 steps\nrequire forall a in objects: speed(a) <= 20 cm/s\n" + TEXT[19:]
    )
    scenegen.sample_motions(moving, n=3).save(tmp_path / "motions.json")
    monkeypatch.setattr("scenegen.page.jobs.motions.most_of", lambda spec: 2)
    found = open_(tmp_path / "motions.json").scenes
    assert [one["title"] for one in found["warnings"]] == ["the first 2 of the 3 motions of motions.json"]


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
    ("name", "data", "better"),
    [
        ("kitchen.png", b"\x89PNG\r\n\x1a\n\0", None),
        ("kitchen.csv", b"a,b\n1,2\n", None),
        ("kitchen.zip", b"PK\3\4\0\xff", None),
        ("kitchen.yaml", b"kitchen:\n  - mug\n", None),
        ("passwd", b"root:x:0:0:root:/root:/bin/sh\n", None),
        ("page.html", b"<!doctype html>\n", None),
        ("empty", b"", None),
        ("large.txt", b"#" * (MAX_TEXT + 1), None),
        ("two.txt", TEXT.encode(), "two.spec"),
        ("two", TEXT.encode(), "two.spec"),
    ],
)
def test_only_what_can_be_a_spec_is_told_to_be_named_so(tmp_path, name, data, better):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(DataError) as error:
        open_(tmp_path / name)
    told = error.value.diagnostics[0]
    assert told.help == (f"name it {better}" if better else told.help) and "spec" in told.help
    assert told.code == ("wrong-ending" if better else "not-opened")


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
    def missing(folder):
        return {one["name"]: one["install"] for one in open_(folder).data()["formats"] if one["install"]}

    monkeypatch.setattr("scenegen.page.project.is_installed", lambda package: package == "pxr")
    assert missing(tmp_path) == {}
    monkeypatch.setattr("scenegen.page.project.is_installed", lambda package: False)
    assert missing(tmp_path) == {"usd": 'pip install "scenegen-dsl[usd]"'}


def test_the_page_is_told_which_methods_and_formats_there_are(tmp_path, monkeypatch, root):
    """So that a further one needs no TypeScript."""
    monkeypatch.setitem(METHODS, "annealing", replace(METHODS["growth"], good_for="cold nights"))
    monkeypatch.setitem(EXPORTS, "blend", "nowhere")
    data = open_(tmp_path).data()
    methods = {one["name"]: (one["motions"], one["model"]) for one in data["methods"]}
    assert methods["auto"] == (True, False) and methods["model"] == (False, True)
    assert methods["annealing"] == methods["growth"] == (False, False)
    titles = {one["name"]: one["title"] for one in data["formats"]}
    assert titles | {"jsonl": "JSON Lines", "sdf": "SDF (Gazebo)", "blend": "blend"} == titles
    assert [one["name"] for one in data["formats"] if one["motions"]] == ["json", "jsonl", "parquet"]
    script = (root / "scenegen" / "page" / "static" / "page.js").read_text(encoding="utf-8")
    assert not any(word in script for word in ("Gazebo", "rejection", "JSON Lines"))


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


TEXT_MODELS = "object block[1..3], plate\ntask: leftOf(block[1], plate)\n"


@pytest.fixture
def folder_models(monkeypatch):
    """A folder of models, as far as they are looked at."""
    models = [(numbers, SimpleNamespace(spec=member)) for numbers, member in scenegen.parse(TEXT_MODELS).members]
    monkeypatch.setattr(sample, "_model", lambda path: SimpleNamespace(members=models))
    return {numbers["block"]: model for numbers, model in models}


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_folder_of_models_has_one_for_each_number_of_things(folder_models, tmp_path, number):
    spec = spec_of({"root": str(tmp_path), "text": TEXT_MODELS, "counts": {"block": number}})
    assert sample._model_of("models", spec) is folder_models[number]


def test_a_model_of_another_spec_is_refused(folder_models, tmp_path):
    spec = spec_of({"root": str(tmp_path), "text": TEXT_MODELS.replace("leftOf", "rightOf")})
    with pytest.raises(RequestError, match="another"):
        sample._model_of("models", spec)


ROOT = Path(__file__).resolve().parents[2]


def test_every_shipped_spec_has_a_topic_and_a_small_picture():
    text = (ROOT / "page" / "src" / "panels" / "Welcome.tsx").read_text()
    topics = text[text.index("const TOPICS") : text.index("];", text.index("const TOPICS"))]
    named = re.findall(r'"([a-z0-9_]+)"', topics)
    assert sorted(named) == sorted(shipped_specs()), "TOPICS of page/src/panels/Welcome.tsx, then `make page`"
    pictures = {one.stem: one.stat().st_size for one in (STATIC / "examples").iterdir()}
    assert pictures.keys() == set(shipped_specs()), "`make page-pictures SPECS=NAME`"
    assert max(pictures.values()) < 20_000


def test_only_a_page_of_nothing_begins_with_them(tmp_path):
    (tmp_path / "one.spec").write_text("leftOf(mug, plate)")
    assert open_(tmp_path).data()["welcome"]
    assert not open_(tmp_path / "one.spec").data()["welcome"] and not open_(Path("first")).data()["welcome"]


PANEL = Path(__file__).parents[2] / "page/src/panels/Request.tsx"


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("spread", "base", "spread: like random scenes"),
        ("method", "growth", "method: growth"),
        ("n", None, "scenes"),
        ("timeout", None, "--timeout of the command line"),
        ("keep_partial", "True", "--keep-partial of the command line"),
        ("fix", "mug=0.5,0.5", "--fix mug=0.5,0.5 of the command line"),
    ],
)
def test_control(name, value, said):
    assert control(name, value) == said


def test_fields_are_those_of_the_page():
    panel = PANEL.read_text()
    assert all(f"<label>{field} " in panel for field in FIELDS.values())
    assert "like random scenes</option>" in panel and "evenly over phi</option>" in panel


def test_refusal_speaks_of_the_page():
    found = refusal(RequestError(NO_TIME_TO_CHECK()))
    assert "--timeout of the command line" in found["help"] and found["help"] in found["text"]
    assert "`timeout`" not in found["text"] and flag("timeout") in found["text"]


def test_ranges_are_told_in_words():
    assert without_command_line("no scene can have phi of `set` in 0:") == "no scene can have phi of `set` in 0 or more"
    assert without_command_line("write 0.01:0.05, or :-1e-3") == "write 0.01 to 0.05, or -1e-3 or less"
    assert without_command_line("-0.2:-0.1") == "-0.2 to -0.1"
    for text in ("my.spec:2:28: unknown", "`task`: 3 of 4", "at 10:15:00", "a:b", "block[1]: 2"):
        assert without_command_line(text) == text
