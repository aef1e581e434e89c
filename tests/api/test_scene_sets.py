"""Sets of scenes in the hands of numpy, torch, pandas and polars. SceneSet: arrays, items, files. Formulas that repeat
share a line, which says what they have in common, and nothing that holds for some only. Heights that a spec
declares reach files, arrays, pictures and simulators.
"""

import json
import math
import re
import sys

import numpy as np
import pandas
import polars
import pytest
import torch

import scenegen
from scenegen.api.outline import FormulaTree, Outline
from scenegen.api.spec import parse
from scenegen.errors import DataError, RequestError
from scenegen.looks.stage import places_of, poses_of, stage_of
from scenegen.sampling.request import Range


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse("object mug, block[2]\ntask: leftOf(mug, block[1])\nsafe: farFrom(mug, block[2])")


@pytest.fixture(scope="module")
def scenes(spec):
    return scenegen.sample(spec, {"task": (0.1, 0.3), "safe": (0.0, None)}, n=9, seed=2)


COLUMNS = [f"{name}.{axis}" for name in ("mug", "block[1]", "block[2]") for axis in ("x", "y", "theta")]
COLUMNS += ["phi.task", "phi.safe"]


def test_numpy(scenes):
    poses, phi = scenes.to_numpy()
    assert np.array_equal(poses, scenes.poses) and phi.shape == (9, 2)
    assert np.array_equal(phi[:, 1], scenes.phi["safe"])
    poses[:], phi[:] = 0.0, 0.0
    assert scenes.poses.any() and scenes.phi["safe"].any(), "these are copies"


def test_torch(scenes, spec):
    poses, phi = scenes.to_torch()
    assert poses.dtype == phi.dtype == torch.float64
    torch.testing.assert_close(spec.robustness()(poses), phi, rtol=0, atol=1e-12)
    poses, phi = scenes.to_torch(torch.float32, "cpu")
    assert poses.dtype == phi.dtype == torch.float32 and poses.shape == (9, 3, 3) and phi.shape == (9, 2)
    assert scenes[:0].to_torch()[1].shape == (0, 2)


def test_pandas(scenes):
    frame = scenes.to_pandas()
    assert list(frame.columns) == COLUMNS and len(frame) == 9
    assert np.array_equal(frame["block[2].y"], scenes.poses[:, 2, 1])
    assert frame[frame["phi.task"] > 0.2].index.tolist() == np.flatnonzero(scenes.phi["task"] > 0.2).tolist()
    assert list(scenes[:0].to_pandas().columns) == COLUMNS


def test_parquet_is_the_same_table_to_pandas_and_polars(scenes, tmp_path):
    path = scenes.save(tmp_path / "s.parquet")
    pandas.testing.assert_frame_equal(pandas.read_parquet(path), scenes.to_pandas(), check_exact=True)
    table = polars.read_parquet(path)
    assert table.columns == COLUMNS and np.array_equal(table.to_numpy(), scenes.to_pandas().to_numpy())
    assert (
        polars.scan_parquet(path).filter(polars.col("phi.task") > 0.2).collect().height
        == (scenes.phi["task"] > 0.2).sum()
    )


def test_without_pandas(scenes, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(scenegen.RequestError, match="and is not installed") as caught:
        scenes.to_pandas()
    assert caught.value.diagnostics[0].help == "pip install pandas"


def test_columns_that_would_share_a_name():
    scenes = scenegen.sample(scenegen.parse("object phi, mug\nx: leftOf(phi, mug)"), n=1)
    with pytest.raises(scenegen.OutputError, match=r"`phi\.x`"):
        scenes.to_pandas()


def test_parts(scenes):
    some = scenes[2:5]
    assert isinstance(some, scenegen.SceneSet) and len(some) == 3 and list(some) == list(scenes)[2:5]
    good = scenes[scenes.phi["task"] > 0.2]
    assert len(good) == (scenes.phi["task"] > 0.2).sum() and (good.phi["task"] > 0.2).all()
    order = np.argsort(scenes.phi["task"])
    assert np.array_equal(scenes[order].phi["task"], np.sort(scenes.phi["task"]))
    assert scenes[np.int64(3)] == scenes[3] and scenes[[3]][0] == scenes[3] and len(scenes[[]]) == 0


@pytest.fixture(scope="module")
def spec_scenes():
    return scenegen.parse("object mug, plate\ntask: leftOf(mug, plate)\nsafe: farFrom(mug, plate)")


@pytest.fixture(scope="module")
def scenes_scenes(spec_scenes):
    return scenegen.sample(spec_scenes, {"task": (0.1, 0.3), "safe": (0.0, None)}, n=12, seed=2)


def test_arrays(scenes_scenes):
    assert len(scenes_scenes) == 12 and scenes_scenes.objects == ("mug", "plate")
    assert scenes_scenes.poses.shape == (12, 2, 3) and scenes_scenes.poses.dtype == np.float64
    assert set(scenes_scenes.phi) == {"task", "safe"} and scenes_scenes.phi["task"].shape == (12,)
    (mug, plate) = scenes_scenes.poses[:, 0], scenes_scenes.poses[:, 1]
    np.testing.assert_allclose(scenes_scenes.phi["task"], plate[:, 0] - mug[:, 0], rtol=0, atol=1e-15)


def test_items(scenes_scenes):
    items = list(scenes_scenes)
    assert len(items) == 12 and items[3] == scenes_scenes[3] and items[-1] == scenes_scenes[-1]
    assert scenes_scenes[3].poses["plate"].theta == scenes_scenes.poses[3, 1, 2]
    assert scenes_scenes[3].phi == {label: values[3] for label, values in scenes_scenes.phi.items()}
    with pytest.raises(IndexError):
        scenes_scenes[12]


def test_what_it_says_of_itself(scenes_scenes):
    low, high = scenes_scenes.phi["task"].min(), scenes_scenes.phi["task"].max()
    assert repr(scenes_scenes).startswith(f"<SceneSet: 12 scenes of mug, plate; phi task {low:.3g}..{high:.3g}, safe ")


def test_files(scenes_scenes, tmp_path):
    path = scenes_scenes.save(str(tmp_path / "s.json"))
    again = scenegen.read_scenes(path)
    assert np.array_equal(again.poses, scenes_scenes.poses)
    assert again.file() == scenes_scenes.file()
    assert again.header.request.phi == {"task": (0.1, 0.3), "safe": (0.0, None)}
    with pytest.raises(scenegen.RequestError, match="not a format"):
        scenes_scenes.save(tmp_path / "s.png")
    with pytest.raises(scenegen.DataError, match="no such file"):
        scenegen.read_scenes(tmp_path / "t.json")


@pytest.mark.long
def test_pictures(scenes_scenes, tmp_path):
    drawn = scenes_scenes.render(tmp_path / "pictures", size=(32, 24), workers=1, views=("top",))
    assert [path.name for path in drawn.pictures][:2] == ["scene_0001_top.png", "scene_0002_top.png"]
    assert len(drawn.pictures) == 12 and drawn.sheet.exists()


def test_ranges_in_every_form(spec_scenes):
    for wanted in ((0.1, 0.3), Range(0.1, 0.3), [0.1, 0.3]):
        assert len(scenegen.sample(spec_scenes, {"task": wanted}, n=2)) == 2
    assert len(scenegen.sample(spec_scenes)) == 16


@pytest.mark.parametrize(
    "options, said",
    [
        ({"method": "modle"}, "did you mean `model`"),
        ({"method": "model"}, "needs a trained model"),
        ({"raw": True}, "no model takes part"),
        ({"timeout": 0}, "timeout"),
        ({"timeout": math.nan}, "timeout"),
        ({"n": 0}, "`n` is 0"),
        ({"phi": {"tsak": (0, 1)}}, "did you mean `task`"),
        ({"phi": {"task": 0.1}}, "lowest, highest"),
        ({"phi": 0.1}, "2 labels, `task` and `safe`"),
        ({"phi": "task=0:1"}, "2 labels"),
        ({"n": 2.0}, "a whole number"),
        ({"seed": "1"}, "a whole number"),
        ({"timeout": "1"}, "positive number"),
        ({"fix": "mug"}, "by name"),
    ],
)
def test_requests_that_cannot_be(spec_scenes, options, said):
    with pytest.raises(scenegen.RequestError, match=said):
        scenegen.sample(spec_scenes, **options)


@pytest.mark.parametrize("wanted", [(0.1, 0.3), [0.1, 0.3], Range(0.1, 0.3)])
def test_a_lone_range_is_of_the_lone_label(wanted):
    phi = scenegen.sample(scenegen.parse("leftOf(mug, plate)"), wanted, n=2).phi["task"]
    assert 0.1 <= phi.min() <= phi.max() <= 0.3


def test_a_lone_range_needs_a_lone_label():
    two = scenegen.parse("easy: leftOf(mug, plate)\nnear: closeTo(mug, plate, 0.2)")
    with pytest.raises(scenegen.RequestError, match=r'phi={"easy": \(lowest, highest\)}'):
        scenegen.sample(two, (0.0, 0.1))


def test_progress_is_told(spec_scenes):
    calls = []
    scenegen.sample(spec_scenes, {"task": (0.5, None)}, n=30_000, progress=lambda *told: calls.append(told))
    found, wanted, candidates = zip(*calls, strict=True)
    assert set(wanted) == {30_000} and list(found) == sorted(found) and found[-1] == 30_000
    assert list(candidates) == sorted(set(candidates)) and candidates[-1] >= 30_000


CASES = {
    "pairs of an array": (
        "object block[16]\nrequire noOverlap()\ntask: leftOf(block[1], block[2])",
        "require",
        ["120 x gap(block[i], block[j]) >= 0 | gap(block[i], block[j])"],
    ),
    "neighbours": (
        "object block[7]\ntask: forall p, q in consecutive(block): leftOf(p, q)",
        "task",
        ["6 x leftOf(block[i], block[i+1]) | x(block[i+1]) - x(block[i])"],
    ),
    "objects with names of their own": (
        "object cup, mug, plate, fork\ntask: forall a, b in objects: farFrom(a, b, 10 cm)",
        "task",
        ["6 x farFrom(p, q, 0.1) | dist(p, q) - 0.1"],
    ),
    "a variable is no object": (
        "object p, mug, plate, i[3]\ntask: (forall a in [p, mug, plate]: x(a) <= 0.5) & (forall a in i: x(a) <= 0.5)",
        "task",
        [
            "all of: forall a in [p, mug, plate] | ",
            "  3 x x(q) <= 0.5 | 0.5 - x(q)",
            "all of: forall a in i | ",
            "  3 x x(i[j]) <= 0.5 | 0.5 - x(i[j])",
        ],
    ),
    "numbers": (
        "object pawn[8]\ntask: forall k in 1..8: x(pawn[k]) <= k * 10 cm",
        "task",
        ["8 x x(pawn[i]) <= 0.1..0.8 | 0.1..0.8 - x(pawn[i])"],
    ),
    "formulas in formulas": (
        "object a[4], b[4]\ntask: forall k in 1..4: leftOf(a[k], b[k]) | aboveOf(b[k], a[k])",
        "task",
        [
            "4 x one of | ",
            "  leftOf(a[i], b[i]) | x(b[i]) - x(a[i])",
            "  aboveOf(b[i], a[i]) | y(b[i]) - y(a[i])",
        ],
    ),
    "as many as there are left": (
        "object a[4]\ntask: forall k in 1..3: forall m in 1..4: x(a[k]) + y(a[m]) <= k",
        "task",
        ["3 x all of: forall m in 1..4 | ", "  4 x x(a[i]) + y(a[j]) <= 1..3 | 1..3 - (x(a[i]) + y(a[j]))"],
    ),
    "what was written by hand": (
        "object a, b, c, d\ntask: leftOf(a, b) & leftOf(b, c) & leftOf(c, d)",
        "task",
        ["leftOf(a, b) | x(b) - x(a)", "leftOf(b, c) | x(c) - x(b)", "leftOf(c, d) | x(d) - x(c)"],
    ),
    "two are shown as they are": (
        "object a[2]\ntask: forall p in a: x(p) <= 0.5",
        "task",
        ["x(a[1]) <= 0.5 | 0.5 - x(a[1])", "x(a[2]) <= 0.5 | 0.5 - x(a[2])"],
    ),
}


def _told(folded, part, depth=0):
    for child in folded.children(part):
        count = f"{child.count} x " if child.count else ""
        yield f"{'  ' * depth}{count}{child.line.text} | {child.line.margin}"
        yield from _told(folded, child, depth + 1)


@pytest.mark.parametrize("name", CASES)
def test_what_is_told(name):
    text, label, expected = CASES[name]
    folded = FormulaTree(Outline(parse(text).checked))
    told = list(_told(folded, folded.root(label)))
    assert [line for line in told if not line.startswith(("all of: noOverlap",))] == expected


def test_bounds_hold_for_all_of_them():
    outline = Outline(parse("object pawn[8]\ntask: forall k in 1..8: x(pawn[k]) <= k * 10 cm").checked)
    folded = FormulaTree(outline)
    (part,) = folded.children(folded.root("task"))
    assert (part.line.low, part.line.high) == pytest.approx((-0.9, 0.8)) and len(part.nodes) == 8


def test_unfolded_every_sub_formula_has_a_line():
    outline = Outline(parse(CASES["pairs of an array"][0]).checked)
    folded = FormulaTree(outline, fold=False)
    found = folded.children(folded.root("require"))
    assert len(found) == 120 and all(len(part.nodes) == 1 and not part.count for part in found)


def test_definitions_used_twice_at_every_level_do_not_grow():
    """2^40 sub-formulas, if each were looked at as often as it is used."""
    text = ["object a[3]", "def f0(p) = leftOf(p, a[1]) & x(p) <= 0.3"]
    text += [f"def f{n}(p) = f{n - 1}(p) | f{n - 1}(p) & y(p) <= 0.{n}" for n in range(1, 13)]
    folded = FormulaTree(Outline(parse("\n".join([*text, "task: forall p in a: f12(p)"])).checked))
    level = [folded.root("task")]
    for _ in range(12):
        level = [child for part in level for child in folded.children(part)][:50]
        assert all(len(part.nodes) <= 3 for part in level)


TEXT = """object tray at (0.5, 0.5, 30 deg), can on tray, low = box(0.2, 0.2, 0.05) at (0.2, 0.2)
object block[2] on [low, block[1]]
require noCollision()
task: leftOf(block[1], can)
"""
HEIGHTS = [0.0, 0.01, 0.0, 0.05, 0.10]
FURNISHED = """object c = cabinet(open = [0, 0.95, 0]) at (0.3, 0.6, SOUTH), spoon on c.drawer[2]
object pot on c.top, lid on pot.rim
object rack at (0.8, 0.2, 30 deg), bottle on rack.slot[2], drawer at (0.8, 0.7, EAST), bin on drawer, apple on bin
object stand at (0.3, 0.1), orange on stand
require noCollision()
task: leftOf(spoon, apple) & inside(pot, c.top) & closeTo(orange, stand, 5 cm)
"""
FURNITURE = {
    "c": 0.0,
    "spoon": 0.148,
    "pot": 0.35,
    "lid": 0.46,
    "rack": 0.0,
    "bottle": 0.01,
    "drawer": 0.0,
    "bin": 0.008,
}
FURNITURE |= {"apple": 0.016, "stand": 0.0, "orange": 0.14}


@pytest.fixture(scope="module")
def scenes_heights():
    return scenegen.sample(scenegen.parse(TEXT), {"task": (0.0, None)}, n=5)


@pytest.mark.long
def test_a_file_says_how_high_objects_stand_and_on_what(scenes_heights, tmp_path):
    for name in ("scenes.json", "scenes.jsonl"):
        again = scenegen.read_scenes(scenes_heights.save(tmp_path / name))
        assert again.header.version == 2
        assert [one.support.z for one in again.header.objects] == pytest.approx(HEIGHTS)
        assert [one.support.on for one in again.header.objects] == ["", "tray.inside", "", "low.top", "block[1].top"]
        assert (again.poses == scenes_heights.poses).all()


def test_a_file_of_a_spec_without_supports_is_version_1(tmp_path):
    plain = scenegen.sample(scenegen.parse("leftOf(mug, plate)"), {"task": (0.0, None)}, n=2)
    data = json.loads(plain.save(tmp_path / "plain.json").read_text())
    assert data["version"] == 1 and all(set(one) == {"name", "shape"} for one in data["objects"])


@pytest.mark.parametrize(("version", "keep"), [(1, True), (2, False), (3, True)])
def test_a_file_whose_version_and_supports_disagree_is_refused(scenes_heights, tmp_path, version, keep):
    data = json.loads(scenes_heights.save(tmp_path / "scenes.json").read_text())
    data["version"] = version
    if not keep:
        del data["objects"][0]["support"]
    (tmp_path / "other.json").write_text(json.dumps(data))
    with pytest.raises(DataError):
        scenegen.read_scenes(tmp_path / "other.json")


def test_poses7(scenes_heights):
    found = scenes_heights.poses7()
    assert found.shape == (5, 5, 7) and found.dtype == np.float64
    assert found[:, :, 2] == pytest.approx(np.tile(HEIGHTS, (5, 1)))
    assert (found[..., :2] == scenes_heights.poses[..., :2]).all()
    assert np.hypot(found[..., 3], found[..., 6]) == pytest.approx(np.ones((5, 5)))
    turned = 2.0 * np.arctan2(found[..., 6], found[..., 3]) % math.tau
    assert turned == pytest.approx(scenes_heights.poses[..., 2])
    assert scenes_heights.poses7(tensor=True, dtype="float32").dtype.is_floating_point
    with pytest.raises(RequestError, match="float32"):
        scenes_heights.poses7(dtype="int8")


def test_heights_that_follow_from_poses_are_in_poses7_too():
    plain = scenegen.sample(scenegen.parse("on(mug, plate)"), {"task": (0.05, None)}, n=1)
    assert plain.poses7()[0, :, 2].tolist() == pytest.approx([0.0074, 0.0], abs=0.02)
    assert plain.poses7()[0, 0, 2] > 0.0


def test_pictures_have_the_same_heights(scenes_heights):
    file = scenes_heights.file()
    assert places_of(stage_of(file), poses_of(file))[..., 3] == pytest.approx(np.tile(HEIGHTS, (5, 1)))


@pytest.fixture(scope="module")
def furnished():
    return scenegen.sample(scenegen.parse(FURNISHED), {"task": (0.0, None)}, n=3)


@pytest.mark.long
def test_furniture_has_one_height_in_files_arrays_pictures_and_gazebo(furnished, tmp_path):
    heights = [FURNITURE[name] for name in furnished.objects]
    assert furnished.poses7()[..., 2] == pytest.approx(np.tile(heights, (3, 1)), abs=1e-6)
    file = scenegen.read_scenes(furnished.save(tmp_path / "scenes.json")).file()
    assert places_of(stage_of(file), poses_of(file))[..., 3] == pytest.approx(np.tile(heights, (3, 1)), abs=1e-6)
    (path,) = furnished[:1].export(tmp_path / "all.sdf")
    for name, (x, y, _), z in zip(furnished.objects, furnished.poses[0], heights, strict=True):
        found = re.search(rf'<model name="{name}">.*?<pose[^>]*>([^<]+)</pose>', path.read_text(), re.DOTALL)
        assert found and [float(one) for one in found[1].split()[:3]] == pytest.approx([x, y, z], abs=1e-6), name


@pytest.mark.long
@pytest.mark.parametrize("which", ["scenes_heights", "furnished"])
def test_mujoco_has_the_same_heights_and_finds_no_collision(which, request, tmp_path):
    """The convex pieces of simulators, at the heights of the file, reach into each other by no more than 0.1 mm."""
    mujoco = pytest.importorskip("mujoco")
    from scenegen.worlds.export.world import world_of

    scenes = request.getfixturevalue(which)
    world = world_of(scenes.header, next(scenes.blocks()))
    heights = HEIGHTS if which == "scenes_heights" else [FURNITURE[name] for name in scenes.objects]
    assert world.poses[..., 2] == pytest.approx(np.tile(heights, (len(scenes), 1)), abs=1e-6)
    scenes.export(tmp_path, "mjcf")
    for number, path in enumerate(sorted(tmp_path.rglob("*.xml"))):
        model = mujoco.MjModel.from_xml_path(str(path))
        data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, 0)
        mujoco.mj_forward(model, data)
        names = {model.body(k).name: k for k in range(model.nbody)}
        for name, pose in zip(scenes.objects, scenes.poses7()[number], strict=True):
            assert data.xpos[names[name]] == pytest.approx(pose[:3], abs=1e-6)
        depths = [contact.dist for contact in data.contact]
        assert min(depths, default=0.0) > -1e-4
