"""Strips, animations, heat maps, the sheet of the library: what they show, not merely that they are files. The contact
sheet: its words, its size, and that nothing runs over. MP4 files: what they show, for how long, and what is said
without PyAV. Top views: well-formed, the same bytes for the same scene, and lines as long as what they say.
"""

import io
import json
import math
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from PIL import Image, ImageFont

import scenegen
from scenegen import needs
from scenegen.geometry import MATH, POINT, Polygon
from scenegen.geometry.clearance import gap, room
from scenegen.lang.checker import check_text
from scenegen.lang.formula.interpret import deciding_atom, evaluate
from scenegen.pictures.figures import heatmap as heat
from scenegen.pictures.figures import sheet
from scenegen.pictures.figures.dimensions import (
    Dimension,
    FigureObject,
    FigureScene,
    Guide,
    Turn,
    dimensions,
    gap_segment,
    room_segment,
    short,
)
from scenegen.pictures.figures.sheet import contact_sheet, describe_ranges, thumbnail_size
from scenegen.pictures.figures.strip import EDGE, FOOT, GAP, LAST_MS, PAGE_MS, animation, strip, video
from scenegen.pictures.figures.topview import Labels, Rect, topview
from scenegen.pictures.render.gallery import gallery, library_sheet, measures
from scenegen.pictures.render.scenes import render_scenes
from scenegen.scenes.data import CountData, Pose, RegionData, SceneData, footprint_data
from scenegen.things import ASSETS, Box, Circle
from tests.laws import examples
from tests.pictures.render.scenefiles import scene_file

RED, GREEN, BLUE = (200, 30, 30), (30, 160, 60), (40, 60, 200)


def opened(data):
    with Image.open(io.BytesIO(data)) as image:
        return np.asarray(image.convert("RGB")).astype(int)


def frames(*colors, size=(60, 40)):
    return [Image.new("RGB", size, color) for color in colors]


def test_a_strip_holds_every_frame_in_order_with_its_phi():
    image = opened(strip(frames(RED, GREEN, BLUE), [-0.4, -0.1, 0.1], "task", ""))
    assert image.shape == (2 * EDGE + 40 + FOOT, 2 * EDGE + 3 * 60 + 2 * GAP, 3)
    for number, color in enumerate((RED, GREEN, BLUE)):
        x = EDGE + number * (60 + GAP)
        assert (image[EDGE : EDGE + 40, x : x + 60] == color).all()
    bars = [
        (np.abs(image[EDGE + 40 + 11, EDGE + k * (60 + GAP) :][:60] - (228, 228, 226)).max(axis=1) > 20).sum()
        for k in range(3)
    ]
    assert bars[0] < bars[1] < bars[2] == 60


def test_a_bar_is_red_as_long_as_the_formula_is_violated():
    image = opened(strip(frames(BLUE, BLUE), [-0.001, 0.001], "task", "a title"))
    left = image[-EDGE - FOOT + 11, EDGE + 2]
    right = image[-EDGE - FOOT + 11, EDGE + 60 + GAP + 2]
    assert left[0] > left[1] + 50 and right[1] > right[0] + 50


def test_an_animation_shows_every_frame_and_rests_on_the_last():
    data = animation(frames(RED, GREEN, BLUE), [-0.4, -0.1, 0.1], "task")
    with Image.open(io.BytesIO(data)) as image:
        assert (image.format, image.n_frames, image.info["loop"]) == ("GIF", 3, 0)
        times = []
        for number, color in enumerate((RED, GREEN, BLUE)):
            image.seek(number)
            times.append(image.info["duration"])
            shown = np.asarray(image.convert("RGB"))[5:35, 5:55].astype(int)
            # One palette, of the first and the last frame, for all.
            assert np.abs(shown - color).max() < (16 if color != GREEN else 255)
    assert times[0] == times[1] < times[2]


def test_density_is_greatest_where_most_scenes_are():
    generator = np.random.default_rng(0)
    many, few = (generator.normal((x, y, 0.0), 0.01, (n, 3)) for x, y, n in ((0.2, 0.7, 90), (1.5, 0.3, 30)))
    found = heat.density(np.concatenate([many, few]), (0.0, 0.0, 2.0, 1.0), (50, 100), 0.03)
    assert found.max() == 1.0 and found.min() >= 0.0
    for start, x, y in ((0, 0.2, 0.7), (60, 1.5, 0.3)):
        part = found[:, start : start + 40]
        row, column = np.unravel_index(part.argmax(), part.shape)
        assert ((column + start + 0.5) * 0.02, 1.0 - (row + 0.5) * 0.02) == pytest.approx((x, y), abs=0.03)
    assert found[:, 60:].max() == pytest.approx(1 / 3, abs=0.05)
    assert (heat.density(np.empty((0, 3)), (0.0, 0.0, 1.0, 1.0), (9, 9), 0.1) == 0.0).all()


def test_a_heat_map_has_a_panel_per_object_with_its_places_its_regions_and_its_heading():
    generator = np.random.default_rng(1)
    rows = [
        [(x, y, t), (1.0 - x, 1.0 - y, u)]
        for x, y, t, u in zip(
            generator.normal(0.25, 0.02, 60),
            generator.normal(0.25, 0.02, 60),
            generator.normal(1.6, 0.1, 60),
            generator.uniform(0.0, 6.28, 60),
            strict=True,
        )
    ]
    mat = RegionData(name="mat", footprint=footprint_data(Box(0.2, 0.2)), pose=Pose(x=0.8, y=0.2, theta=0.0))
    disc = RegionData(name="disc", footprint=footprint_data(Circle(0.1)), pose=Pose(x=0.2, y=0.8, theta=0.0))
    image = opened(heat.heatmap(scene_file(["mug", "apple"], rows, regions=[mat, disc])))
    blank = opened(heat.heatmap(scene_file(["mug", "apple"], [[(9.0, 9.0, 0.0), (9.0, 9.0, 0.0)]])))
    assert image.shape == blank.shape
    panels = [image[-328:-28, 28 + k * 318 :][:, :300] for k in (0, 1)]

    def ink(panel, x, y):
        return np.abs(panel[round((1 - y) * 299), round(x * 299)] - heat.BARE_TABLE_COLOR).sum()

    for panel, (x, y) in zip(panels, ((0.25, 0.25), (0.75, 0.75)), strict=True):
        assert ink(panel, x + 0.03, y) > 150 > 20 > ink(panel, 0.5, 0.5)
        assert ink(panel, 0.8, 0.2) > 20 and ink(panel, 0.2, 0.8) > 20  # both regions
    white = [(panel == 255).all(axis=2).sum() for panel in panels]
    assert white[0] > 50 and white[1] == 0  # headings of the mug agree, of the apple they do not


def test_a_heat_map_of_a_thread_has_room_for_its_title():
    """A spread of 20 km over a workspace of a metre is not worked out metre by metre; titles go on a second line."""
    file = scene_file(["mug"], [[(5e4, 0.5, 0.0)]], x=(0.0, 1e5), y=(0.0, 1.0))
    title = "A mug somewhere along a road that is far longer than it is wide."
    low = opened(heat.heatmap(file))
    high = opened(heat.heatmap(file.model_copy(update={"spec": file.spec.model_copy(update={"title": title})})))
    assert high.shape[0] > low.shape[0] and high.shape[1] == low.shape[1]


@pytest.mark.long
def test_the_gallery_shows_every_asset_whole_and_large():
    names = ["pen", "laptop"]
    found = gallery(names, (96, 72), workers=1)
    assert list(found) == names
    for name in names:
        picture = opened(found[name])
        assert picture.shape == (72, 96, 3)
        saturated = np.ptp(picture.astype(int), axis=2) > 12  # the ground behind is grey
        assert not saturated[0].any() and saturated.any(axis=0).mean() > 0.7
    assert found["pen"] != found["laptop"]
    sheet = opened(library_sheet(found))
    assert sheet.std() > 10
    assert measures(ASSETS["mug"]) == "12.4 x 12.4 x 9.5 cm, 350 g"


@pytest.mark.long
def test_unknown_objects_are_blocks_with_their_names_beside_them(tmp_path):
    """Known ones have none; and no name is written where programs are to learn from the pictures."""
    rows = [[(0.3, 0.4, 0.0), (0.7, 0.6, 0.0)]]
    renders = {}
    options = {"size": (200, 150), "workers": 1, "views": ("top",)}
    for kind, names in (("named", ["mug", "gizmo"]), ("plain", ["mug", "gizmo"]), ("known", ["mug", "block"])):
        done = render_scenes(scene_file(names, rows), tmp_path / kind, masks=kind == "plain", **options)
        renders[kind] = opened(done.pictures[0].read_bytes())
        assert json.loads(done.cameras.read_text())["ids"]["3"] == names[1]
    white = {key: (picture > 245).all(axis=2).sum() for key, picture in renders.items()}
    assert white["named"] > white["plain"] + 60
    assert abs(white["known"] - white["plain"]) < 20


ONE = [[(0.5, 0.5, 0.0)]]


def drawn(file, count, size=(80, 60)):
    with Image.open(io.BytesIO(contact_sheet(file, [Image.new("RGB", size, (0, 90, 200))] * count))) as image:
        return np.asarray(image.convert("RGB"))


def test_ranges_in_words():
    assert describe_ranges({"task": (0.05, 0.2), "safe": (0.0, None)}) == "task 0.05..0.2, safe >= 0"
    assert describe_ranges({"a": (None, 1.5), "b": (None, None)}) == "a <= 1.5, b any"
    assert describe_ranges({}) == "nothing in particular"


@pytest.mark.parametrize("count", [1, 2, 5, 16, 64])
def test_the_sheet_holds_every_picture_once(count):
    image = drawn(scene_file(["mug"], ONE * count), count)
    blue = (image == (0, 90, 200)).all(axis=2)
    assert blue.sum() == count * 80 * 60
    margin = sheet.EDGE
    border = np.concatenate([image[:margin].ravel(), image[-margin:].ravel(), image[:, :margin].ravel()])
    assert (border.reshape(-1, 3) == sheet.PAPER).all()
    assert (image[:, -margin:] == sheet.PAPER).all()
    assert 0.5 < image.shape[1] / image.shape[0] < 2.5


def scene(phi, counts=None):
    return SceneData(counts=counts, poses={}, phi=phi)


def test_captions_show_number_and_phi_and_stay_in_their_cell():
    font = ImageFont.load_default(size=sheet.SMALL)
    lines = sheet._caption(3, scene({"task": 0.12, "safe": 0.31}), [], [], font, 240)
    assert [[text for text, _ in line] for line in lines] == [["#3", "task 0.12", "safe 0.31"]]
    counts = [
        CountData(name="block", least=2, most=5),
        CountData(name="mug", least=1, most=2, assets=["red", "w" * 100]),
    ]
    lines = sheet._caption(3, scene({"task": 0.12}, {"block": 4, "mug": 1}), counts, [], font, 240)
    assert [[text for text, _ in line] for line in lines] == [["#3", "block[4]", "mug:red", "task 0.12"]]
    lines = sheet._caption(3, scene({}, {"block": 4, "mug": 2}), counts, [], font, 240)
    assert lines[1][0][0].startswith("mug:w") and font.getlength(lines[1][0][0]) <= 240
    many = {f"a_label_whose_name_goes_on_and_on_and_on_{k}": -0.1234 * k for k in range(30)}
    lines = sheet._caption(1, scene(many), [], [], font, 240)
    assert len(lines) == sheet.CAPTION_LINES
    for line in lines:
        assert font.getlength("   ".join(text for text, _ in line)) <= 240
    assert lines[1][0][0].endswith("... 0")  # the label gives way, the figure stays
    assert lines[-1][0][0] == f"and {30 - (sheet.CAPTION_LINES - 2)} more"


def test_a_long_header_keeps_within_the_sheet():
    source = "# " + "a very long sentence about mugs " * 12 + "W" * 400 + "\ntask: leftOf(mug, plate)\n"
    ranges = {f"label_{k}": (0.0, 1.0) for k in range(12)}
    image = drawn(scene_file(["mug"], ONE * 2, source=source, asked=ranges), 2)
    assert (image[:, -sheet.EDGE :] == sheet.PAPER).all()


def test_captions_say_what_overlaps():
    font = ImageFont.load_default(size=sheet.SMALL)
    words = ["mug overlaps plate", "fork overlaps plate"]
    lines = sheet._caption(2, scene({"task": 0.1}), [], words, font, 240)
    assert [line for line in lines if line[0][1] == sheet.WARM] == [[(text, sheet.WARM)] for text in words]
    lines = sheet._caption(2, scene({"task": 0.1}), [], [*words, *words], font, 240)
    assert [text for line in lines[1:] for text, _ in line] == [*words, "4 overlaps in all"]
    # And it is the scenes' own overlaps that a sheet shows: a mug half through a plate costs a line.
    apart, through = ([[(0.5, 0.5, 0.0), (x, 0.5, 0.0)]] for x in (0.9, 0.65))
    one, other = (drawn(scene_file(["plate", "mug"], poses), 1, (240, 180)) for poses in (apart, through))
    assert other.shape[0] == one.shape[0] + sheet.LINE


def test_thumbnails_keep_the_shape_of_pictures():
    assert thumbnail_size((640, 480), 16) == (320, 240)
    assert thumbnail_size((640, 480), 64) == (240, 180)
    assert thumbnail_size((960, 320), 16) == (480, 160)  # as many pixels
    assert thumbnail_size((100, 1000), 1)[1] <= 320
    assert min(thumbnail_size((4096, 16), 64)) >= 1


COLORS = (200, 30, 30), (30, 160, 60), (40, 60, 200)


def pages(size=(61, 43)):
    return [Image.new("RGB", size, color) for color in COLORS]


def test_every_page_is_shown_and_the_last_one_is_held():
    av = pytest.importorskip("av")
    data = video(pages(), PAGE_MS, LAST_MS)
    assert data == video(pages(), PAGE_MS, LAST_MS)
    assert data.index(b"moov") < data.index(b"mdat")  # it plays before the whole file is there
    with av.open(io.BytesIO(data)) as file:
        stream = file.streams.video[0]
        assert (stream.codec_context.name, stream.width, stream.height) == ("h264", 62, 44)
        assert float(stream.duration * stream.time_base) * 1000 == pytest.approx(2 * PAGE_MS + LAST_MS, abs=PAGE_MS)
        shown = [np.asarray(frame.to_image()).astype(int) for frame in file.decode(stream)]
    assert len(shown) == 2 + -(-LAST_MS // PAGE_MS)
    for frame, color in zip(shown, [*COLORS, COLORS[-1]], strict=False):
        assert np.abs(frame[5:35, 5:55] - color).max() < 16
    assert (shown[0][-1, 5:55] > 180).any()  # the row that makes the height even is paper


@pytest.fixture(scope="module")
def motions():
    spec = scenegen.parse("object mug\ntime 1 steps\nrequire speed(mug) <= 30 cm/s\ntask: eventually moved(mug, 5 cm)")
    return scenegen.sample_motions(spec, n=2)


def test_without_pyav_one_sentence_says_what_to_install(motions, tmp_path, monkeypatch):
    monkeypatch.setattr(needs, "is_installed", lambda package: package != "av")
    for draw in (lambda: motions.animate(tmp_path / "x.mp4", 1), lambda: motions.figures(tmp_path / "all", "mp4")):
        with pytest.raises(scenegen.RequestError, match=r"av is needed for MP4 files, and is not installed") as error:
            draw()
        assert 'pip install "scenegen-dsl[video]"' in str(error.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "motion", "code"),
    [
        ("x.gif", None, "not-one-motion"),
        ("x.gif", 0, "no-such-number"),
        ("x.gif", 3, "no-such-number"),
        ("x.mov", 1, "unknown-choice"),
        ("x", 1, "unknown-choice"),
        ("none/x.gif", 1, "cannot-write"),
    ],
)
def test_what_cannot_be_drawn(motions, tmp_path, name, motion, code):
    with pytest.raises(scenegen.ScenegenError) as error:
        motions.animate(tmp_path / name, motion)
    assert error.value.diagnostics[0].code == code
    assert not list(tmp_path.iterdir())


SVG = "{http://www.w3.org/2000/svg}"
WEDGE = Polygon(((-0.1, -0.1), (0.2, 0.0), (-0.1, 0.1)))
footprints = st.sampled_from([POINT, Circle(0.1), Box(0.2, 0.1), Box(0.4, 0.4), WEDGE])
places = st.floats(-0.5, 0.5)
poses = st.tuples(places, places, st.floats(0.0, 6.28))


def length(segment):
    return math.dist(*segment)


@settings(max_examples=examples(300))
@given(footprints, poses, footprints, poses)
def test_lines_are_as_long_as_the_clearance(a, a_pose, b, b_pose):
    segment = gap_segment(a, a_pose, b, b_pose)
    assert length(segment) == pytest.approx(abs(gap(MATH, a, b, *a_pose, *b_pose)), abs=1e-9)
    segment = room_segment(a, a_pose, b, b_pose)
    if b != POINT or a != POINT:
        assert length(segment) == pytest.approx(abs(room(MATH, a, b, *a_pose, *b_pose)), abs=1e-9)


@settings(max_examples=examples(100))
@given(footprints, poses, footprints, poses)
def test_the_ends_of_a_gap_lie_on_the_footprints(a, a_pose, b, b_pose):
    assume(gap(MATH, a, b, *a_pose, *b_pose) > 0.0)
    for (x, y), one, pose in zip(gap_segment(a, a_pose, b, b_pose), (a, b), (a_pose, b_pose), strict=True):
        assert gap(MATH, POINT, one, x, y, 0.0, *pose) <= 1e-9


def marks(text, *scene):
    core = check_text(text).core
    rows = [number for pose in scene for number in pose]
    values = evaluate(core, rows)
    return dimensions(core, deciding_atom(core, next(iter(core.labels)), values), rows)


MUG, PLATE = (0.2, 0.3, 0.0), (0.5, 0.7, 0.0)
OBJECTS = "object mug = cylinder(0.05, 0.1), plate = cylinder(0.1, 0.02)\n"


@pytest.mark.parametrize(
    ("formula", "expected"),
    [
        ("dist(mug, plate) <= 10 cm", [Dimension((0.2, 0.3), (0.5, 0.7), "0.5 m", False)]),
        ("x(mug) <= 0.45", [Dimension((0.2, 0.3), (0.45, 0.3), "0.25 m")]),
        ("0.05 <= x(mug)", [Dimension((0.05, 0.3), (0.2, 0.3), "0.15 m")]),
        ("y(plate) + 1 <= 1.2", [Dimension((0.5, 0.7), (0.5, 1.2 - 1), "0.5 m", False)]),
        (
            "x(mug) <= x(plate) - 1",
            [
                Guide((0.2, 0.3), (0.2, 0.5)),
                Guide((0.5, 0.7), (0.5, 0.5)),
                Dimension((0.2, 0.5), (0.5, 0.5), "0.3 m", False),
            ],
        ),
        ("abs(x(mug) - 0.3) <= 1 cm", [Dimension((0.3, 0.3), (0.2, 0.3), "0.1 m", False)]),
        ("theta(mug) <= 1", []),
        ("x(mug) * y(mug) <= 1", []),
        ("x(mug) + x(plate) <= 1", []),
        ("x(mug) + y(mug) <= 1", []),
        ("2 * x(mug) <= 1", []),
    ],
)
def test_what_an_atom_measures(formula, expected):
    found = marks(f"{OBJECTS}task: {formula}", MUG, PLATE)
    assert [type(mark) for mark in found] == [type(mark) for mark in expected]
    for mark, wanted in zip(found, expected, strict=True):
        assert (*mark.start, *mark.end) == pytest.approx((*wanted.start, *wanted.end))
        if isinstance(mark, Dimension):
            assert (mark.text, mark.good) == (wanted.text, wanted.good)


def test_edges_are_measured_from_edges():
    (left, right, line) = marks(f"{OBJECTS}task: fullyLeftOf(mug, plate)", MUG, PLATE)
    assert (line.start, line.end) == (pytest.approx((0.25, 0.5)), pytest.approx((0.4, 0.5)))
    assert (left.start, right.start) == (pytest.approx((0.25, 0.3)), pytest.approx((0.4, 0.7)))


def test_an_angle_turns_from_the_heading_that_was_wanted():
    (turn,) = marks(f"{OBJECTS}task: angle(mug, NORTH)", (0.2, 0.3, 1.0), PLATE)
    assert (turn.center, turn.start, turn.stop) == ((0.2, 0.3), pytest.approx(math.pi / 2), 1.0)
    assert (turn.text, turn.good) == ("0.571 rad", False)


VIEW = FigureScene(
    [
        FigureObject("mat & <co>", Box(0.4, 0.2), (0.5, 0.1, 0.0), zone=True),
        FigureObject("mug", Circle(0.05), (0.2, 0.3, 1.0)),
        FigureObject("wedge", WEDGE, (0.7, 0.6, 0.5), tint="#abcdef"),
    ],
    marks=[
        Dimension((0.2, 0.3), (0.7, 0.6), "0.583 m", False),
        Turn((0.2, 0.3), 0.0, 1.0, "1 rad"),
        Guide((0, 0), (1, 1)),
    ],
    caption=["closeTo(mug, wedge)", "phi = \N{MINUS SIGN}0.333"],
    good=False,
)


def test_a_view_is_well_formed_and_the_same_every_time():
    text = topview(VIEW)
    assert text == topview(VIEW)
    root = ET.fromstring(text)
    assert [one.text for one in root.iter(f"{SVG}text")][-2:] == list(VIEW.caption)
    assert {"mat & <co>", "mug", "wedge", "0.583 m", "1 rad"} <= {one.text for one in root.iter(f"{SVG}text")}
    assert root.get("width") == "240"


def test_views_stand_side_by_side():
    root = ET.fromstring(topview(VIEW, VIEW, VIEW, width=300))
    assert root.get("width") == "900"
    assert [group.get("transform") for group in root.iter(f"{SVG}g")] == [None, "translate(300 0)", "translate(600 0)"]


def test_y_points_upwards():
    low, high = (topview(FigureScene([FigureObject("a", Circle(0.05), (0.5, y, 0.0))])) for y in (0.2, 0.8))
    assert float(circle(low).get("cy")) > float(circle(high).get("cy"))


def circle(text):
    return next(ET.fromstring(text).iter(f"{SVG}circle"))


def test_what_sticks_out_is_drawn_in_full_unless_it_is_far_away():
    near = circle(topview(FigureScene([FigureObject("a", Circle(0.1), (1.05, 0.5, 0.0))])))
    assert float(near.get("cx")) + float(near.get("r")) <= 240.0
    far = circle(topview(FigureScene([FigureObject("a", Circle(0.1), (9.0, 0.5, 0.0))])))
    assert float(far.get("cx")) > 240.0


def test_what_reaches_over_the_frame_is_cut_off_there():
    """Else a region would run under the caption, and into the view beside."""
    over = FigureScene([FigureObject("reach", Circle(0.6), (0.5, 0.0, 0.0), zone=True)], caption=["a", "b"])
    root = ET.fromstring(topview(over, VIEW))
    (frame,) = root.iter(f"{SVG}clipPath")
    (group,) = (one for one in root.iter(f"{SVG}g") if one.get("clip-path") == f"url(#{frame.get('id')})")
    assert len(list(group.iter(f"{SVG}circle"))) == 1 and not list(group.iter(f"{SVG}text"))
    (rect,) = frame
    bottom = float(rect.get("y")) + float(rect.get("height"))
    captions = [float(one.get("y")) for one in root.iter(f"{SVG}text") if one.text in ("a", "b")]
    assert min(captions) - 11 >= bottom - 2.0
    assert "clip" not in topview(VIEW)


@pytest.mark.parametrize("far", [1e4, 1e7, 1e300])
def test_marks_may_end_anywhere(far):
    """A line of 1e300 pixels is as quickly kept clear of labels as any other, and drawn in numbers that can be read."""
    marks = [Dimension((0.2, 0.3), (far, 0.6), "far", False), Guide((-far, far), (far, 0.0))]
    text = topview(FigureScene([FigureObject("mug", Circle(0.05), (far, 0.3, 1.0))], marks=marks))
    numbers = [abs(float(one)) for one in re.findall(r"[ML]([-\d.]+)", text)]
    assert len(numbers) >= 4 and max(numbers) <= 20_010.0 and len(text) < 5000


def test_a_workspace_of_any_size():
    for size in (1e-3, 1.0, 7.0, 1e6):
        text = topview(
            FigureScene(
                [FigureObject("a", Circle(size / 10), (size / 2, size / 2, 0.0))], x=(0.0, size), y=(0.0, 2 * size)
            )
        )
        assert ET.fromstring(text).get("height") == "456" and len(text) < 3000


def test_labels_keep_off_each_other_and_in_the_frame():
    labels = Labels(Rect(0.0, 0.0, 100.0, 50.0))
    assert labels.place([(50.0, 25.0), (50.0, 40.0)], 40.0, 10.0) == (50.0, 25.0)
    assert labels.place([(50.0, 25.0), (50.0, 40.0)], 40.0, 10.0) == (50.0, 40.0)
    assert labels.place([(99.0, 0.0)], 40.0, 10.0) == (80.0, 5.0)


def test_short_numbers():
    assert [short(value) for value in (0.1, -0.25, -1e-9, 1.0, 0.12345)] == [
        "0.1",
        "\N{MINUS SIGN}0.25",
        "0",
        "1",
        "0.123",
    ]


def test_furniture_shows_its_cells():
    from scenegen.things import shape_of
    from scenegen.things.surfaces import cells_of

    shapes = {name: shape_of(name) for name in ("rack", "cabinet", "bin", "mug")}
    for name, cells in {"rack": 6, "cabinet": 1, "bin": 1, "mug": 0}.items():
        thing = FigureObject(name, shapes[name].footprint, (0.5, 0.5, 0.3), inside=cells_of(shapes[name]))
        assert topview(FigureScene([thing])).count('stroke-width="0.6"') == cells
