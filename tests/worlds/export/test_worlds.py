"""What holds for every simulator's format: files appear together or not at all, names are safe, bad scenes are told."""

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pytest

from scenegen.errors import DataError, OutputError, RequestError, SpecError
from scenegen.scenes import files as folders
from scenegen.scenes.data import CircleFootprint, PolygonFootprint
from scenegen.scenes.formats.registry import FORMAT_OF_ENDING, FORMATS
from scenegen.worlds.export.world import world_of
from scenegen.worlds.exporting import EXPORTS
from tests.worlds.export.checkers import CHECKERS
from tests.worlds.export.worlds import crates, scenes_of

PAIR = "object mug, plate\ntask: leftOf(mug, plate)"
PLACES = {"mug": (0.2, 0.5, 0.0), "plate": (0.6, 0.5, 0.0)}


def renamed(scenes, name, title="A title."):
    """The same scenes, the first object and the spec's title called otherwise."""
    first, *rest = scenes.header.objects
    objects = [first.model_copy(update={"name": name}), *rest]
    spec = scenes.header.spec.model_copy(update={"title": title})
    header = scenes.header.model_copy(update={"objects": objects, "spec": spec})
    return type(scenes)(scenes.poses, scenes.phi, header, trusted=True)


def test_every_format_has_an_ending():
    assert set(FORMAT_OF_ENDING.values()) == {*EXPORTS, "pddl"} and not set(FORMAT_OF_ENDING) & set(FORMATS)


def test_every_format_has_a_checker():
    """And its files have the ending that they say."""
    assert set(CHECKERS) == set(EXPORTS)
    assert {to: FORMAT_OF_ENDING[Path(one.file).suffix] for to, one in CHECKERS.items()} == {to: to for to in EXPORTS}


@pytest.mark.parametrize("to", EXPORTS)
def test_the_same_bytes_again(to, tmp_path):
    made = []
    for name in ("one", "two"):
        crates().export(tmp_path / name, to)
        made.append({str(p.relative_to(tmp_path / name)): p.read_bytes() for p in (tmp_path / name).rglob("*.*")})
    assert made[0] == made[1] and len(made[0]) >= (4 if CHECKERS[to].meshes else 2)


@pytest.mark.long
@pytest.mark.parametrize("to", EXPORTS)
@pytest.mark.parametrize("target", ["folder", "file"])
@pytest.mark.parametrize("there", [False, True])
def test_a_failure_leaves_nothing(to, target, there, tmp_path, monkeypatch):
    out = tmp_path / (CHECKERS[to].file if target == "file" else "worlds")
    scenes = scenes_of(PAIR, *[PLACES] * 3)
    if there:
        scenes.export(out, to)
    before = {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")}
    write, written, last = folders._write, [], None

    def failing(path, data):
        written.append(path)
        if len(written) == last:
            raise KeyboardInterrupt
        write(path, data)

    monkeypatch.setattr(folders, "_write", failing)
    (tmp_path / "whole").mkdir()
    scenes[:2].export(tmp_path / "whole" / out.name, to)  # which says how many files there are
    shutil.rmtree(tmp_path / "whole")
    last, written = len(written), []
    with pytest.raises(KeyboardInterrupt):
        scenes[:2].export(out, to)
    assert {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")} == before


@pytest.mark.long
@pytest.mark.parametrize("to", EXPORTS)
@pytest.mark.parametrize("name", ['a "quoted" <name> & more', "mes\u00e1 \U0001f35c", "table", "floor"])
def test_names_of_any_kind(to, name, tmp_path):
    scenes = renamed(scenes_of(PAIR, PLACES), name, "A title\x00 \x1b with <odd> letters")
    (path,) = scenes.export(tmp_path / CHECKERS[to].file)
    assert CHECKERS[to].names(path).count(name) == 1
    assert CHECKERS[to].masses(path)[name] == pytest.approx(0.35)
    CHECKERS[to].check(path)


@pytest.mark.parametrize("to", EXPORTS)
@pytest.mark.parametrize("name", ["world", "__mug__", "a::b", "a\x00b", "a\nb", ""])
def test_names_that_cannot_be(to, name, tmp_path):
    with pytest.raises(DataError, match="an object's name") as caught:
        renamed(scenes_of(PAIR, PLACES), name).export(tmp_path / CHECKERS[to].file)
    assert caught.value.diagnostics[0].help and list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("to", EXPORTS)
def test_scenes_that_no_table_holds(to, tmp_path):
    scenes = scenes_of(PAIR, PLACES, PLACES | {"plate": (0.5, -1e6, 0.0)})
    with pytest.raises(DataError, match="`plate` stands 1e\\+06 m off the workspace in scene 2"):
        scenes.export(tmp_path / CHECKERS[to].file)
    with pytest.raises(RequestError, match="no scenes"):
        scenes[:0].export(tmp_path / CHECKERS[to].file)
    assert list(tmp_path.iterdir()) == []


def test_the_table_holds_everything(tmp_path):
    import mujoco

    far = {"mug": (1.8, -0.7, 0.0), "plate": (0.5, 0.5, 0.0)}
    (path,) = scenes_of(PAIR, PLACES, far).export(tmp_path / "all.xml")
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 1)
    for _ in range(100):
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(data.body("mug").xpos, [1.8, -0.7, 0.0], atol=1e-3)


@pytest.mark.parametrize("to", EXPORTS)
def test_regions_end_where_the_table_does(to, tmp_path):
    text = """object mug, plate
region reach = circle((0.5, 0), 0.5)
region off = rect(3, 3, 4, 4)
region seat = rect(0.25, 0.25, 0.75, 0.75)
task: leftOf(mug, plate)
"""
    scenes = scenes_of(text, PLACES)
    world = world_of(scenes.header, next(scenes.blocks()))
    left, front, right, back = world.table
    reach, seat = (np.array(patch.corners) for patch in world.patches)
    assert reach[:, 1].min() == pytest.approx(front) and reach[:, 1].max() == pytest.approx(0.5)
    assert reach[:, 0].min() > left and reach[:, 0].max() < right and back > 1.0
    assert seat.min() == 0.25 and seat.max() == 0.75
    (path,) = scenes.export(tmp_path / CHECKERS[to].file)
    assert CHECKERS[to].regions(path) == 2


def test_files_of_the_user_stand_as_their_outline(tmp_path):
    """The files themselves are not needed: scene files are whole without them."""
    import mujoco

    shapes = 'tray = urdf("a/tray.urdf", box(0.3, 0.2, 0.05)), toy = mesh("../toy.stl", cylinder(0.03, 0.1))'
    text = f"object mug, {shapes}\ntask: leftOf(mug, tray)"
    places = {"mug": (0.1, 0.5, 0.0), "tray": (0.5, 0.5, 0.3), "toy": (0.8, 0.5, 0.0)}
    (path,) = scenes_of(text, places).export(tmp_path / "all.xml")
    model = mujoco.MjModel.from_xml_path(str(path))
    assert model.body("tray").mass == pytest.approx(500.0 * 0.3 * 0.2 * 0.05)
    np.testing.assert_allclose(model.body("toy").ipos, [0.0, 0.0, 0.05], atol=1e-9)


@pytest.mark.parametrize("to", EXPORTS)
def test_a_link_stays_and_what_it_points_to_is_written(to, tmp_path):
    (tmp_path / "there").mkdir()
    link, target = tmp_path / CHECKERS[to].file, tmp_path / "there" / "target"
    link.symlink_to(target)
    scenes_of(PAIR, PLACES).export(link)
    assert link.is_symlink() and target.is_file() and "mug" in CHECKERS[to].names(link)
    beside = {"all_meshes"} if CHECKERS[to].meshes else set()
    assert {path.name for path in tmp_path.iterdir()} == {"there", CHECKERS[to].file} | beside


def test_a_folder_in_the_way_of_a_file_is_found_before_anything_is_written(tmp_path):
    (tmp_path / "worlds" / "scene_0002.xml").mkdir(parents=True)
    with pytest.raises(OutputError, match=r"scene_0002\.xml: is a directory") as caught:
        scenes_of(PAIR, PLACES, PLACES).export(tmp_path / "worlds", "mjcf")
    assert caught.value.diagnostics[0].help
    assert [path.name for path in (tmp_path / "worlds").iterdir()] == ["scene_0002.xml"]


def test_places_that_cannot_be(tmp_path):
    scenes = scenes_of(PAIR, PLACES)
    (tmp_path / "taken").write_text("mine")
    for out, to, error, said in (
        ("x.sdf", "mjcf", RequestError, r"has the ending of sdf, not of mjcf"),
        ("x.json", "sdf", RequestError, r"has the ending of scene files, not of sdf"),
        ("taken", "mjcf", OutputError, r"it is a file, and a folder is made for mjcf"),
        ("no/such", "mjcf", OutputError, r"no such file"),
        ("no/such.xml", None, OutputError, r"no such file"),
        ("worlds", None, RequestError, r"no format was given"),
        ("worlds", "urdf", RequestError, r"unknown format `urdf`"),
        ("x.parquet", "json", RequestError, r"does not end in \.json"),
    ):
        with pytest.raises(error, match=said) as caught:
            scenes.export(tmp_path / out, to)
        assert caught.value.diagnostics[0].help
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]


def _giant(header):
    shape = header.objects[0].shape.model_copy(update={"height": 1e300})
    return {"objects": [header.objects[0].model_copy(update={"shape": shape}), *header.objects[1:]]}


def _dust(header):
    footprint = CircleFootprint(radius=1e-300)
    shape = header.objects[0].shape.model_copy(update={"footprint": footprint})
    return {"objects": [header.objects[0].model_copy(update={"shape": shape}), *header.objects[1:]]}


def _sliver(header):
    footprint = PolygonFootprint(vertices=[(0.0, 0.0), (2e-6, 2e-6), (1e-6, 1e-6 + 1e-10)])
    shape = header.objects[0].shape.model_copy(update={"footprint": footprint, "height": 1e-6})
    return {"objects": [header.objects[0].model_copy(update={"shape": shape}), *header.objects[1:]]}


def _space(header):
    return {"workspace": header.workspace.model_copy(update={"x": (0.0, 1e300)})}


def _nowhere(header):
    return {"workspace": header.workspace.model_copy(update={"x": (0.0, 0.0)})}


def _odd_spec(header):
    source = "object mug, plate\ntask: leftof(mug, plate)\n"
    sha256 = hashlib.sha256(source.encode()).hexdigest()
    return {"spec": header.spec.model_copy(update={"source": source, "sha256": sha256})}


@pytest.mark.parametrize("to", EXPORTS)
@pytest.mark.parametrize("change", [_giant, _dust, _sliver, _space, _nowhere, _odd_spec])
def test_files_that_no_spec_makes(change, to, tmp_path):
    """Scene files may hold any number: each is told from sense by one diagnostic."""
    scenes = scenes_of(PAIR, PLACES)
    header = scenes.header.model_copy(update=change(scenes.header))
    broken = type(scenes)(scenes.poses, scenes.phi, header, trusted=True)
    with pytest.raises((DataError, SpecError)) as caught:
        broken.export(tmp_path / CHECKERS[to].file)
    assert len(caught.value.diagnostics) == 1 and caught.value.diagnostics[0].help
    assert list(tmp_path.iterdir()) == []
