"""`scenegen render` with its options, and `scenegen assets`. `scenegen export`: formats go into one another, and
simulators get files that they load. `sample --settle`: scenes that stay put, counted by object where they do not.
"""

import json
import subprocess
import sys

import mujoco
import numpy as np
import pybullet
import pytest

from scenegen.things import shape_of
from tests.corpus import read_corpus
from tests.worlds.physics.drops import settle_scenes

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
        (["--camera", "front"], "unknown camera `front`"),
        (["--camera", "front", "--view", "top"], "--camera is a view"),
        (["--camera", "front", "--figure", "sheet"], "--camera goes with pictures"),
    ):
        told = scenegen("render", "s.json", "--out", "no", *options, *SMALL)
        assert told.status == 1 and words in told.err and not (scenes / "no").exists()


SEEN = """camera front = at (0.4, -0.5, 0.6) looks at (0.5, 0.5, 0) fov 40 deg, 3:2
camera look = at (0.5, 0.5, 1.5) looks at (0.5, 0.5, 0) fov 50 deg, 1:1
object mug, plate
task: visible(mug, front)
"""


@pytest.mark.long
def test_pictures_from_the_cameras_of_the_spec(here, scenegen):
    """The picture is that of the camera: an object is where the file of cameras says, and a mask has it there."""
    (here / "seen.spec").write_text(SEEN)
    assert scenegen("sample", "seen.spec", "--phi", "0:", "-n", "2", "--out", "s.json").status == 0
    told = scenegen("render", "s.json", "--out", "p", "--camera", "front", "--size", "150x100", "--masks")
    assert told.status == 0, told.err
    names = {f"scene_000{k}_front{end}" for k in (1, 2) for end in (".png", "_mask.png", ".npz")}
    assert {path.name for path in (here / "p").iterdir()} == names | {"cameras.json", "contact_sheet.png"}
    lens = json.loads((here / "p" / "cameras.json").read_text())["views"]["front"]
    assert lens["intrinsics"]["fy"] == pytest.approx(50.0 / np.tan(np.radians(20.0)))
    matrix = np.array(lens["world_to_camera"])
    assert np.linalg.inv(matrix)[:3, 3] == pytest.approx([0.4, -0.5, 0.6])
    for number, scene in enumerate(json.loads((here / "s.json").read_text())["scenes"], start=1):
        plate = scene["poses"]["plate"]
        x, y, z = (matrix @ (plate["x"], plate["y"], 0.02, 1.0))[:3]
        u, v = (lens["intrinsics"]["fx"] * x / z + 75.0, lens["intrinsics"]["fy"] * y / z + 50.0)
        mask = np.load(here / "p" / f"scene_000{number}_front.npz")["mask"]
        if 1 < u < 149 and 1 < v < 99:
            assert mask[int(v), int(u)] in (2, 3)  # the plate, or the mug before it
    # a camera may have any name, and wears a look
    told = scenegen("render", "s.json", "--out", "q", "--camera", "look", "--looks", "random", "--size", "60x60")
    assert told.status == 0 and (here / "q" / "scene_0001_look.png").exists(), told.err
    assert json.loads((here / "q" / "cameras.json").read_text())["views"]["look"]["intrinsics"]["cx"] == 30.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["fron"], "did you mean `front`"),
        (["front", "--size", "100x100"], "must be of the shape that `front` has, such as 679x453"),
    ],
)
def test_cameras_that_are_not_there(here, scenegen, options, words):
    (here / "seen.spec").write_text(SEEN)
    assert scenegen("sample", "seen.spec", "-n", "1", "--out", "s.json").status == 0
    told = scenegen("render", "s.json", "--out", "p", "--camera", *options)
    assert told.status == 1 and words in told.err and not (here / "p").exists()


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


WANTED = ["--phi", "0:0.2", "-n", "3", "--seed", "5"]


@pytest.fixture
def scenes_export(scenegen, here):
    assert scenegen("sample", "good.spec", *WANTED, "--out", "s.json").status == 0
    return here / "s.json"


def files(folder):
    return sorted(path.name for path in folder.iterdir())


def test_scene_files_go_round(scenegen, here, scenes_export):
    for source, out, words in (
        ("s.json", "s.parquet", []),
        ("s.parquet", "s.jsonl", ["--to", "jsonl"]),
        ("s.jsonl", "t.json", ["--to", "json"]),
    ):
        done = scenegen("export", source, *words, "--out", out)
        assert (done.status, done.out, done.err) == (0, "", f"3 scenes in {out}\n")
    assert (here / "t.json").read_bytes() == scenes_export.read_bytes()
    assert scenegen("sample", "good.spec", *WANTED, "--out", "direct.parquet").status == 0
    assert (here / "direct.parquet").read_bytes() == (here / "s.parquet").read_bytes()


def test_mujoco_loads_what_is_written(scenegen, here, scenes_export):
    done = scenegen("export", "s.json", "--to", "mjcf", "--out", "worlds")
    assert (done.status, done.out) == (0, "")
    assert done.err == "3 scenes in worlds: scene_0001.xml to scene_0003.xml\n"
    assert files(here / "worlds") == ["meshes", "scene_0001.xml", "scene_0002.xml", "scene_0003.xml"]
    assert mujoco.MjModel.from_xml_path(str(here / "worlds" / "scene_0002.xml")).nkey == 0
    done = scenegen("export", "s.json", "--out", "all.xml")
    assert (done.status, done.err) == (0, "3 scenes in all.xml\n")
    assert mujoco.MjModel.from_xml_path(str(here / "all.xml")).nkey == 3
    # it can be moved, and loaded from anywhere
    (here / "worlds").rename(here / "moved")
    assert mujoco.MjModel.from_xml_path(str(here / "moved" / "scene_0003.xml")).body("mug").mass > 0.0


def test_pybullet_loads_what_is_written(scenegen, here, scenes_export):
    assert scenegen("export", "s.json", "--to", "sdf", "--out", "worlds").status == 0
    client = pybullet.connect(pybullet.DIRECT)
    loaded = pybullet.loadSDF(str(here / "worlds" / "scene_0003.sdf"), physicsClientId=client)
    pybullet.disconnect(physicsClientId=client)
    assert len(loaded) == 4  # floor, table, mug, plate


@pytest.mark.long
def test_usd_opens_what_is_written(scenegen, here, scenes_export):
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed (pip install 'scenegen-dsl[usd]')")
    done = scenegen("export", "s.json", "--to", "usd", "--out", "stages")
    assert (done.status, done.out, done.err) == (0, "", "3 scenes in stages: scene_0001.usda to scene_0003.usda\n")
    assert files(here / "stages") == ["meshes", "scene_0001.usda", "scene_0002.usda", "scene_0003.usda"]
    stage = usd.Stage.Open(str(here / "stages" / "scene_0002.usda"))
    assert stage.GetPrimAtPath("/Scene/mug").GetAttribute("physics:mass").Get() > 0.0
    done = scenegen("export", "s.json", "--out", "all.usdc")
    assert (done.status, done.err) == (0, "3 scenes in all.usdc\n")
    stage = usd.Stage.Open(str(here / "all.usdc"))
    assert len(stage.GetDefaultPrim().GetVariantSet("scene").GetVariantNames()) == 3


@pytest.mark.parametrize("name", [name for name in read_corpus("cli/errors/requests") if name.startswith("export_")])
def test_what_is_refused(name, refusal, scenes_export):
    refusal("requests", name)


def test_no_scenes(refused, scenes_export, here):
    text = scenes_export.read_text()
    scenes_export.write_text(text[: text.index('"scenes": [')] + '"scenes": []}\n')
    assert "there are no scenes" in refused("export", "s.json", "--out", "all.xml")


@pytest.mark.long
def test_only_what_is_asked_for_is_loaded(scenes_export):
    program = (
        "import sys; from scenegen.cli.app import run; status = run(['export', 's.json', '--out', 'all.xml']);"
        "print(status, *sorted({'torch', 'pybullet', 'pyarrow', 'pandas', 'mujoco', 'PIL', 'pxr'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=scenes_export.parent, capture_output=True, text=True, timeout=60)
    assert done.stdout == "0\n", done.stderr


def test_files_of_an_earlier_run_are_told_of_and_left_alone(scenegen, here, scenes_export):
    (here / "export").mkdir()
    for name in ("scene_0001.sdf", "scene_0003.xml", "scene_0004.xml", "scene_00001.xml", "scene_x.xml"):
        (here / "export" / name).touch()
    done = scenegen("export", "s.json", "--to", "mjcf", "--out", "export")
    assert done.err.endswith("note[other-files]: 2 other files scene_*.xml in export are not of these scenes\n")
    assert len(files(here / "export")) == 8
    (here / "views").mkdir()
    (here / "views" / "scene_0004_topview.svg").touch()
    done = scenegen("render", "s.json", "--figure", "topview", "--out", "views")
    assert done.err.endswith("note[other-files]: another file scene_*_topview.svg in views is not of these scenes\n")
    assert len(files(here / "views")) == 4


OVERLAPPING = "object mug, crackerbox\ntask: leftOf(mug, crackerbox) & closeTo(mug, crackerbox, 15 cm)\n"


def test_what_is_handed_out_settles(scenegen, here):
    (here / "near.spec").write_text(OVERLAPPING)
    words = ["sample", "near.spec", "--phi", "0:", "-n", "6", "--seed", "4"]
    assert scenegen(*words, "--out", "any.json").status == 0
    outcome = scenegen(*words, "--settle", "--out", "still.json")
    assert outcome.status == 0
    assert "scenes did not settle: " in outcome.err and "`mug` moved in " in outcome.err
    kept = {}
    for name in ("any", "still"):
        data = json.loads((here / f"{name}.json").read_text())
        poses = [[list(scene["poses"][one].values()) for one in ("mug", "crackerbox")] for scene in data["scenes"]]
        kept[name] = settle_scenes([shape_of("mug"), shape_of("crackerbox")], np.array(poses), workers=1).stays
        assert data["sampler"].get("settled", False) == (name == "still")
    assert kept["still"].all() and not kept["any"].all()


@pytest.mark.long
def test_the_number_of_processes_changes_nothing(scenegen, here):
    (here / "near.spec").write_text(OVERLAPPING)
    words = ["sample", "near.spec", "--phi", "0:0.03", "-n", "6", "--settle"]
    assert scenegen(*words, "--workers", "1", "--out", "one.jsonl").status == 0
    assert scenegen(*words, "--workers", "2", "--out", "two.jsonl").status == 0
    assert (here / "one.jsonl").read_bytes() == (here / "two.jsonl").read_bytes()


def test_what_stands_in_a_tray_settles(scenegen, here):
    """Specs that declare heights: bodies have their own pieces, so that a can is in the tray, not on top of it."""
    (here / "carried.spec").write_text("object tray at (0.5, 0.5), can on tray\ntask: leftOf(can, tray)\n")
    words = ["sample", "carried.spec", "--settle", "-n", "3", "--workers", "1", "--out", "kept.json"]
    assert scenegen(*words).status == 0
    assert json.loads((here / "kept.json").read_text())["sampler"]["settled"]


def test_settle_counts_in_its_last_line(scenegen, here):
    (here / "near.spec").write_text(OVERLAPPING)
    assert scenegen("sample", "near.spec", "--phi", "0:", "-n", "6", "--seed", "4", "--out", "any.json").status == 0
    words = ["settle", "any.json", "--in", "pybullet", "--seconds", "0.2", "--workers", "1"]
    outcome = scenegen(*words, "--max-shift", "5 mm", "--max-turn", "0.05rad", "--out", "rest.jsonl")
    assert outcome.status == 0, outcome.err
    header, *lines = map(json.loads, (here / "rest.jsonl").read_text().splitlines())
    good = sum(line["settled"] for line in lines)
    assert len(lines) == 6 and good < 6
    assert (header["max_shift_mm"], round(header["max_turn_deg"], 6)) == (5.0, 2.864789)
    last = outcome.err.splitlines()[-1]
    assert last.startswith(f"{good} of 6 scenes settled (pybullet, 0.2 s); in {6 - good} an object moved too far: ")
    wrong = scenegen(*words, "--max-shift", "5", "--out", "other.jsonl")
    assert wrong.status == 1 and "a length with its unit" in wrong.err and not (here / "other.jsonl").exists()
    over = scenegen(*words, "--out", "any.json")
    assert over.status == 1 and "any.json" in over.err
