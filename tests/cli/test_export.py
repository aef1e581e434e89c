"""`scenegen export`: formats go into one another, and simulators get files that they load."""

import subprocess
import sys

import mujoco
import pybullet
import pytest

WANTED = ["--phi", "0:0.2", "-n", "3", "--seed", "5"]


@pytest.fixture
def scenes(scenegen, here):
    assert scenegen("sample", "good.spec", *WANTED, "--out", "s.json").status == 0
    return here / "s.json"


def files(folder):
    return sorted(path.name for path in folder.iterdir())


def test_scene_files_go_round(scenegen, here, scenes):
    for source, out, words in (
        ("s.json", "s.parquet", []),
        ("s.parquet", "s.jsonl", ["--to", "jsonl"]),
        ("s.jsonl", "t.json", ["--to", "json"]),
    ):
        done = scenegen("export", source, *words, "--out", out)
        assert (done.status, done.out, done.err) == (0, "", f"3 scenes in {out}\n")
    assert (here / "t.json").read_bytes() == scenes.read_bytes()
    assert scenegen("sample", "good.spec", *WANTED, "--out", "direct.parquet").status == 0
    assert (here / "direct.parquet").read_bytes() == (here / "s.parquet").read_bytes()


def test_mujoco_loads_what_is_written(scenegen, here, scenes):
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


def test_pybullet_loads_what_is_written(scenegen, here, scenes):
    assert scenegen("export", "s.json", "--to", "sdf", "--out", "worlds").status == 0
    client = pybullet.connect(pybullet.DIRECT)
    loaded = pybullet.loadSDF(str(here / "worlds" / "scene_0003.sdf"), physicsClientId=client)
    pybullet.disconnect(physicsClientId=client)
    assert len(loaded) == 4  # floor, table, mug, plate


@pytest.mark.long
def test_usd_opens_what_is_written(scenegen, here, scenes):
    usd = pytest.importorskip("pxr.Usd", reason="usd-core is not installed (pip install 'scenegen[usd]')")
    done = scenegen("export", "s.json", "--to", "usd", "--out", "stages")
    assert (done.status, done.out, done.err) == (0, "", "3 scenes in stages: scene_0001.usda to scene_0003.usda\n")
    assert files(here / "stages") == ["meshes", "scene_0001.usda", "scene_0002.usda", "scene_0003.usda"]
    stage = usd.Stage.Open(str(here / "stages" / "scene_0002.usda"))
    assert stage.GetPrimAtPath("/Scene/mug").GetAttribute("physics:mass").Get() > 0.0
    done = scenegen("export", "s.json", "--out", "all.usdc")
    assert (done.status, done.err) == (0, "3 scenes in all.usdc\n")
    stage = usd.Stage.Open(str(here / "all.usdc"))
    assert len(stage.GetDefaultPrim().GetVariantSet("scene").GetVariantNames()) == 3


def test_what_is_refused(refused, scenes, here, golden):
    said = [
        refused("export", "s.json", "--out", "worlds"),
        refused("export", "s.json", "--to", "mjfc", "--out", "worlds"),
        refused("export", "s.json", "--to", "mjcf", "--out", "s.json"),
        refused("export", "s.json", "--to", "sdf", "--out", "all.xml"),
        refused("export", "s.json", "--to", "json", "--out", "s.jsonl"),
        refused("export", "s.json", "--out", "s.json"),
        refused("export", "t.json", "--out", "all.xml"),
        refused("export", "good.spec", "--out", "all.xml"),
        refused("sample", "good.spec", "--out", "all.xml"),
    ]
    golden("cli/errors/export.txt", "\n".join(said))


def test_no_scenes(refused, scenes, here):
    text = scenes.read_text()
    scenes.write_text(text[: text.index('"scenes": [')] + '"scenes": []}\n')
    assert "there are no scenes" in refused("export", "s.json", "--out", "all.xml")


@pytest.mark.long
def test_only_what_is_asked_for_is_loaded(scenes):
    program = (
        "import sys; from scenegen.cli.app import run; status = run(['export', 's.json', '--out', 'all.xml']);"
        "print(status, *sorted({'torch', 'pybullet', 'pyarrow', 'pandas', 'mujoco', 'PIL', 'pxr'} & set(sys.modules)))"
    )
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, cwd=scenes.parent, capture_output=True, text=True, timeout=60)
    assert done.stdout == "0\n", done.stderr


def test_files_of_an_earlier_run_are_told_of_and_left_alone(scenegen, here, scenes):
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
