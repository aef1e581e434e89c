"""The contact sheet: its words, its size, and that nothing runs over."""

import io

import numpy as np
import pytest
from PIL import Image, ImageFont

from scenegen.scenes.data import CountData, SceneData
from scenegen.show.figures import sheet
from scenegen.show.figures.sheet import asked, contact_sheet, thumbnail_size
from tests.render.scenefiles import scene_file

ONE = [[(0.5, 0.5, 0.0)]]


def drawn(file, count, size=(80, 60)):
    with Image.open(io.BytesIO(contact_sheet(file, [Image.new("RGB", size, (0, 90, 200))] * count))) as image:
        return np.asarray(image.convert("RGB"))


def test_ranges_in_words():
    assert asked({"task": (0.05, 0.2), "safe": (0.0, None)}) == "task 0.05..0.2, safe >= 0"
    assert asked({"a": (None, 1.5), "b": (None, None)}) == "a <= 1.5, b any"
    assert asked({}) == "nothing in particular"


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
