"""Randomised looks: drawn by seed and index, whole in the picture, recorded, and refused where they are wrong."""

import json

import numpy as np
import pytest
from PIL import Image

from scenegen.errors import DataError, RequestError
from scenegen.looks.configuration import read_looks
from scenegen.looks.stage import stage_of
from scenegen.pictures.render.scenes import render_scenes
from tests.looks.pictures import four_colors

from .scenefiles import scene_file

SIZE = (64, 48)
FILE = scene_file(["mug"], [[(0.5, 0.5, 0.0)], [(0.2, 0.8, 0.0)]])


def written(folder, text):
    (folder / "looks.toml").write_text(text)
    return folder / "looks.toml"


def test_the_preset_varies_and_shows_the_whole_table_from_above():
    looks = read_looks("random")
    drawn = [looks.draw_look(3, index) for index in range(200)]
    points = stage_of(FILE).corners()
    for look in drawn:
        camera = look.camera(points, SIZE)
        pixels = camera.project(points)
        assert (pixels >= 0.0).all() and (pixels <= SIZE).all()
        assert np.linalg.inv(camera.view)[2, 3] > 0.0  # the eye is above the table
    assert len({look.table_color for look in drawn}) == 200
    assert looks.draw_look(3, 7) == drawn[7] != looks.draw_look(4, 7)


def test_another_distribution_of_one_entry_leaves_the_others(tmp_path):
    one = read_looks(written(tmp_path, "[camera]\nfov = {uniform = [20, 60]}\nelevation = 30\n")).draw_look(0, 0)
    other = read_looks(written(tmp_path, "camera.fov = {uniform = [20, 60]}\ntable.color = 'red'\n")).draw_look(0, 0)
    assert one.camera_fov == other.camera_fov and 20.0 <= one.camera_fov <= 60.0
    assert (one.camera_elevation, other.camera_elevation, other.table_color) == (30.0, 50.0, (1.0, 0.0, 0.0))


@pytest.mark.long
def test_pictures_do_not_depend_on_workers_and_the_record_places_objects(tmp_path):
    drawn = render_scenes(FILE, tmp_path / "a", size=SIZE, masks=True, looks="random", seed=5, workers=1)
    again = render_scenes(FILE, tmp_path / "b", size=SIZE, masks=True, looks="random", seed=5, workers=2)
    assert [one.read_bytes() for one in drawn.pictures] == [one.read_bytes() for one in again.pictures]
    records = [json.loads(line) for line in (tmp_path / "a" / "looks.jsonl").read_text().splitlines()]
    for record, (x, y) in zip(records, [(0.5, 0.5), (0.2, 0.8)], strict=True):
        (name,) = record["pictures"]
        mask = np.asarray(Image.open(tmp_path / "a" / name.replace(".png", "_mask.png")))
        at = np.array(record["intrinsics"]) @ (np.array(record["world_to_camera"]) @ [x, y, 0.05, 1.0])[:3]
        rows, columns = np.nonzero(mask == 2)
        middle = columns.mean() + 0.5, rows.mean() + 0.5
        assert at[:2] / at[2] == pytest.approx(middle, abs=2.0)


@pytest.mark.long
def test_a_plain_red_table_on_a_green_ground(tmp_path):
    text = "table = {color = 'red', texture = 'plain'}\nground = {color = '#00ff00'}\n"
    drawn = render_scenes(FILE, tmp_path / "a", size=SIZE, looks=written(tmp_path, text), workers=1)
    picture = np.asarray(Image.open(drawn.pictures[0]))
    assert picture[40, 32, 0] > 150 > 60 > picture[40, 32, 1]
    assert picture[0, 0, 1] > 150 > 60 > picture[0, 0, 0]


@pytest.mark.long
def test_depth_is_ahead_of_the_camera_above_the_horizon_too(tmp_path):
    looks = written(tmp_path, "[camera]\nelevation = 5\nfov = 100\n")
    render_scenes(FILE, tmp_path / "a", size=SIZE, looks=looks, depth=True, workers=1)
    depth = np.load(tmp_path / "a" / "scene_0001_look.npz")["depth"]
    assert (depth > 0.0).all() and (depth[0] == depth.max()).all()  # nothing is farther than the horizon


@pytest.mark.parametrize(
    ("text", "place", "said"),
    [
        ("[camera]\nelevation = 95", "2:1", "it is not from 5 to 89"),
        ("[camera]\n\nazimut = 3", "3:1", "did you mean `azimuth`?"),
        ("[light]\nazimuth = 1\n[camera]\nazimuth = 999", "4:1", "it is not"),
        ("table.color = 'brwon'", "1:1", "did you mean `brown`?"),
        ("[table]\ntexture = 'marble'", "2:1", "wood"),
        ("[lights]\n", "1:2", "did you mean `light`?"),
        ("camera = 3", "1:1", "expected a table"),
        ("[camera]\nfov = {normal = [1, 2]}", "2:1", "within"),
        ("[camera]\nfov = {choice = []}", "2:1", "at least one"),
        ("[camera]\nfov = nan", "2:1", "expected a number"),
        ("[ground]\ncolor = {hsv = [[0, 1], [1, 0], [0, 1]]}", "2:1", "smaller number first"),
        ("[camera", "1:8", ""),
        ("[camera]\nfov = 1" + 400 * "0", "2:1", "it is not"),
        ("[camera]\nfov = inf", "2:1", "it is not"),
        ("x = " + 5000 * "1", "1:5005", ""),
        ("[walls]\ndistance = -1", "2:1", "it is not from 0 to 20"),
        ("[walls]\ntexture = 'brick.png'", "2:1", "cannot read brick.png: No such file"),
        ("[walls]\ntexture = '../brick.png'", "2:1", "cannot read ../brick.png: it is not in the folder"),
        ("[walls]\ntexture = '/etc/brick.png'", "2:1", "cannot read /etc/brick.png: it is not in the folder"),
        ("[ground]\ntexture = 'wood'", "2:1", "expected"),
        ("[table]\ntexture = 'chekcer'", "2:1", "did you mean `checker`?"),
        ("[table]\ntexture = {files = 'none/*.jpg'}", "2:1", "there is no .png or .jpg file none/*.jpg"),
        ("[table]\ntexture = {files = '../*.jpg'}", "2:1", "below the folder"),
        ("[table]\ntexture = 'looks.toml.png'", "2:1", "cannot read"),
        ("[table]\ntexture_size = 0", "2:1", "it is not from 0.01"),
        ("[camera]\nfov = 30\nfocal_length = 35", "1:2", "leave one out"),
        ("[camera]\nposition = [0, 0, 1]\nazimuth = 3", "1:2", "leave out azimuth"),
        ("[camera]\nlook_at = [0, 0, 1]", "1:2", "look_at goes with position"),
        ("[camera]\nposition = [0, 0]", "2:1", "expected [x, y, z]"),
        ("[camera]\nposition = [0, 0, -1]", "2:1", "it is not from 0.05"),
        ("[camera]\nposition = [0, {uniform = [2, 1]}, 1]", "2:1", "smaller number first"),
        ("[objects]\nhue = 3", "2:1", "it is not from -1 to 1"),
        ("[objects]\ncolour = 'red'", "2:1", "there are hue"),
    ],
)
def test_each_bad_entry_is_one_diagnostic_at_its_place(tmp_path, text, place, said):
    with pytest.raises(DataError) as found:
        read_looks(written(tmp_path, text))
    (one,) = found.value.diagnostics
    assert one.code == "bad-looks" and said in one.text("title") and one.span.place.endswith(place)


def test_a_seed_is_checked_and_the_view_needs_looks(tmp_path):
    with pytest.raises(RequestError, match="seed"):
        render_scenes(FILE, tmp_path / "a", looks="random", seed=-1)
    with pytest.raises(RequestError, match="unknown view"):
        render_scenes(FILE, tmp_path / "a", views=("look",))


def test_a_picture_that_is_none_is_refused_at_its_key(tmp_path):
    (tmp_path / "bad.png").write_bytes(b"no picture")
    with pytest.raises(DataError, match=r"cannot use bad.png: it is not a PNG or JPEG picture"):
        read_looks(written(tmp_path, "[walls]\ntexture = 'bad.png'\n"))


def test_a_texture_from_a_file_keeps_its_colours_unless_one_is_given(tmp_path):
    four_colors(tmp_path)
    drawn = read_looks(
        written(tmp_path, "table.texture = 'four.png'\nwalls.texture = 'four.png'\nwalls.color = 'red'\n")
    )
    look = drawn.draw_look(0, 0)
    assert look.table_color == (1.0, 1.0, 1.0) and look.walls_color == (1.0, 0.0, 0.0)
    assert look.walls_distance == 0.6  # a table [walls] is enough for walls
    assert set(drawn.files) == {"four.png"}


@pytest.mark.long
def test_walls_are_as_far_away_as_they_should_be_in_their_colour_and_texture(tmp_path):
    """The camera looks straight at the wall behind the table, whose texture is four quarters."""
    four_colors(tmp_path, size=(64, 64))
    text = """
[walls]
distance = 0.5
texture = "four.png"
texture_size = 40
[camera]
position = [0.5, -1, 0.4]
look_at = [0.5, 9, 0.4]
fov = 60
"""
    drawn = render_scenes(FILE, tmp_path / "a", size=(160, 120), depth=True, masks=True, looks=written(tmp_path, text))
    arrays = np.load(tmp_path / "a" / "scene_0001_look.npz")
    table = stage_of(FILE).table
    wall = np.zeros_like(arrays["mask"], dtype=bool)
    wall[:40] = True
    assert (arrays["mask"][wall] == 0).all()
    np.testing.assert_allclose(arrays["depth"][20, 40:120], table[3] + 0.5 + 1.0, rtol=1e-4)
    picture = np.asarray(Image.open(drawn.pictures[0])).astype(int)
    left, right = picture[20, 45], picture[20, 115]  # x < 0 and x > 0 on the wall, above z = 0: white and blue
    assert left.min() > 100 and abs(left - left.mean()).max() < 30
    assert right[2] > 100 and right[0] < 40
    assert json.loads(drawn.cameras.read_text())["ids"]["0"] == "ground and walls"


@pytest.mark.long
def test_objects_change_their_colours_and_nothing_else_changes(tmp_path):
    plain = render_scenes(FILE, tmp_path / "a", size=SIZE, masks=True, looks=written(tmp_path, ""))
    tinted = render_scenes(FILE, tmp_path / "b", size=SIZE, looks=written(tmp_path, "[objects]\nhue = 0.5\n"))
    mask = np.load(tmp_path / "a" / "scene_0001_look.npz")["mask"]
    one, other = (np.asarray(Image.open(drawn.pictures[0])).astype(int) for drawn in (plain, tinted))
    changed = np.abs(one - other).max(axis=2) > 8
    assert changed[mask == 2].mean() > 0.5 and not changed[mask == 0].any()
    lines = (tmp_path / "b" / "looks.jsonl").read_text().splitlines()
    assert json.loads(lines[0])["look"]["objects"] == {"mug": {"hue": 0.5, "saturation": 1.0, "brightness": 1.0}}


def test_each_object_has_a_tint_of_its_own_that_depends_on_its_name_alone(tmp_path):
    looks = read_looks(written(tmp_path, "[objects]\nhue = {uniform = [-0.5, 0.5]}\n"))
    mug, plate = looks.draw_look(3, 5, ["mug", "plate"]).tints
    assert mug.hue != plate.hue and looks.draw_look(3, 5, ["plate"]).tints == (plate,)
