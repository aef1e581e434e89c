"""`scenegen render` with its options, and `scenegen assets`."""

import json

import pytest

SMALL = ["--size", "48x36", "--workers", "1"]


@pytest.fixture
def scenes(here, scenegen):
    assert scenegen("sample", "good.spec", "--phi", "0:0.3", "-n", "2", "--out", "s.json").status == 0
    return here


@pytest.mark.long
def test_views_depth_and_masks(scenes, scenegen):
    told = scenegen(
        "render", "s.json", "--out", "p", "--view", "front", "--view", "three-quarter", "--depth", "--masks",
        "--transparent", *SMALL,
    )  # fmt: skip
    assert told.status == 0 and "drew 4 pictures in p (" in told.err and "scenes/s)" in told.err
    endings = [".png", "_depth.png", "_mask.png", ".npz"]
    names = {f"scene_000{k}_{view}{end}" for k in (1, 2) for view in ("front", "three-quarter") for end in endings}
    assert {path.name for path in (scenes / "p").iterdir()} == names | {"cameras.json", "contact_sheet.png"}
    assert set(json.loads((scenes / "p" / "cameras.json").read_text())["views"]) == {"front", "three-quarter"}


def test_figures(scenes, scenegen):
    told = scenegen("render", "s.json", "--out", "f", "--figure", "heatmap", "--figure", "topview", *SMALL)
    assert told.status == 0 and "heatmap.png" in told.err
    names = {"heatmap.png", "scene_0001_topview.svg", "scene_0002_topview.svg"}
    assert {path.name for path in (scenes / "f").iterdir()} == names


def test_options_that_do_not_go_together(scenes, scenegen):
    for options, words in (
        (["--figure", "sheet", "--depth"], "--depth goes with pictures"),
        (["--figure", "sheet", "--masks"], "--masks goes with pictures"),
        (["--figure", "sheet", "--transparent"], "--transparent goes with pictures"),
        (["--figure", "sheet", "--renderer", "egl"], "--renderer goes with pictures"),
        (["--figure", "sheet", "--view", "top", "--view", "front"], "--view may be given once"),
        (["--label", "task"], "--label goes with --figure"),
        (["--renderer", "opengl"], "unknown renderer `opengl`"),
        (["--view", "topp"], "did you mean `top`"),
    ):
        told = scenegen("render", "s.json", "--out", "no", *options, *SMALL)
        assert told.status == 1 and words in told.err and not (scenes / "no").exists()


def test_the_library_as_a_table_and_as_json(scenegen, golden, here):
    told = scenegen("assets")
    assert (told.status, told.err) == (0, "")
    golden("cli/assets/table.txt", told.out)
    rows = json.loads(scenegen("assets", "mug", "Box", "mug_2", "--json").out)
    assert [row["name"] for row in rows] == ["mug", "carton"]
    assert rows[0] == {
        "name": "mug",
        "footprint": {"kind": "circle", "radius": 0.062},
        "height": 0.095,
        "mass": 0.35,
        "friction": 0.45,
        "color": [0.14, 0.45, 0.5],
        "hollow": True,
        "surfaces": {
            "inside": {
                "length": pytest.approx(0.0598, abs=1e-4),
                "width": pytest.approx(0.0598, abs=1e-4),
                "depth": 0.085,
            }
        },
    }


@pytest.mark.long
def test_pictures_of_assets(scenegen, here):
    told = scenegen("assets", "pen", "marker", "--out", "a", *SMALL)
    assert told.status == 0 and "drew 3 pictures in a" in told.err
    assert {path.name for path in (here / "a").iterdir()} == {"pen.png", "marker.png", "contact_sheet.png"}


def test_an_asset_that_is_not_there(scenegen, here):
    told = scenegen("assets", "mugg", "--out", "a")
    assert (told.status, told.out) == (1, "") and "did you mean `mug`" in told.err and not (here / "a").exists()


@pytest.mark.long
def test_how_many_pictures(scenegen, here, small_pictures):
    words = ("sample", "good.spec", "-n", "3", "--out", "s.json", "--render", "some", "--pictures", "1")
    assert scenegen(*words).status == 0
    assert sorted(one.name for one in (here / "some").glob("scene_*_top.png")) == ["scene_0001_top.png"]
    assert scenegen("render", "s.json", "--out", "two", "--pictures", "2").status == 0
    assert len(list((here / "two").glob("scene_*_top.png"))) == 2
    for refused in (
        ("sample", "good.spec", "-n", "3", "--pictures", "1"),
        ("render", "s.json", "--out", "none", "--pictures", "0"),
        ("render", "s.json", "--out", "none", "--pictures", "1", "--figure", "sheet"),
    ):
        outcome = scenegen(*refused)
        assert outcome.status == 1 and "--pictures" in outcome.err and not (here / "none").exists()
