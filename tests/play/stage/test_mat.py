"""The mat and sheets: lengths as a PDF reader has them, names of places, and what is refused."""

import re
import zlib
from dataclasses import replace

import numpy as np
import pytest

from scenegen.errors import RequestError
from scenegen.play.stage.pdf import PAPER_EDGE, PAPERS, PaperDrawing, Stroke, write_pdf
from scenegen.play.stage.sheet import draw_start, write_card
from scenegen.play.stage.stage import TableStage, outline_at

MM = 25.4 / 72.0
NUMBER = rb"(-?[\d.]+)"


def pages_of(data):
    """The drawn polygons of each page: lists of corners in mm from the lower left of the page."""
    streams = [
        zlib.decompress(one) for one in re.findall(rb"stream\n(.*?)\nendstream", data, re.DOTALL) if one[:1] == b"x"
    ]
    pages = []
    for text in (one for one in streams if b" m\n" in one):
        found = []
        for x, y, step in re.findall(NUMBER + rb" " + NUMBER + rb" ([ml])\n", text):
            found += [[]] if step == b"m" else []
            found[-1].append((float(x) * MM, float(y) * MM))
        pages.append(list(map(np.array, found)))
    return pages


def test_lengths_read_back_from_the_file(stage):
    pytest.importorskip("fpdf")
    pytest.importorskip("cv2")
    from scenegen.play.stage.mat import draw_mat

    drawing = draw_mat(stage, "mine", "a0")
    (page,) = pages_of(write_pdf([drawing]))
    squares = [one for one in page if len(one) == 4 and np.allclose(np.ptp(one, axis=0), 1000.0 * stage.tag, atol=0.1)]
    assert len(squares) == 4
    found = np.array([one[np.lexsort((one[:, 1], one[:, 0]))] for one in squares])
    wanted = 1000.0 * np.array([one[np.lexsort((one[:, 1], one[:, 0]))] for one in stage.tag_corners()])
    shift = found[0, 0] - wanted[0, 0]
    assert np.abs(found - wanted - shift).max() < 0.1
    ruler = next(one for one in page if len(one) == 2 and np.ptp(one[:, 1]) == 0.0 and np.ptp(one[:, 0]) < 150.0)
    assert abs(np.ptp(ruler[:, 0]) - 100.0) < 0.1


def test_tiles_continue_each_other():
    pytest.importorskip("fpdf")
    line = Stroke([(0.0, 0.1), (0.5, 0.1)])
    pages = pages_of(write_pdf([PaperDrawing((0.0, 0.0), (0.5, 0.15), [line], "a4", "long")]))
    room = PAPERS["a4"][1] - 2.0 * PAPER_EDGE
    ends = [next(one for one in page if len(one) == 2 and np.ptp(one[:, 1]) == 0.0)[:, 0] for page in pages]
    assert len(ends) == 2 and ends[0] - ends[1] == pytest.approx([room, room], abs=0.1)
    assert np.ptp(ends[0]) == pytest.approx(500.0, abs=0.1)


def test_names_of_places(stage):
    assert stage.lines(0)[0] == ("A", pytest.approx(-0.14)) and stage.lines(1)[-1] == ("15", pytest.approx(0.14))
    assert stage.name_place(-0.10, -0.08) == "C4"
    assert stage.name_place(-0.097, -0.089) == "C4 + 0.3 cm right, 0.9 cm near"
    fine = replace(stage, step=0.01)
    assert [name for name, _ in fine.lines(0)][24:28] == ["Y", "Z", "AA", "AB"]


def test_a_card_and_a_sheet_are_of_the_start(stage, suite):
    start = suite[7]
    card = write_card(stage, start)
    assert card.startswith("episode 7: beside, level3. ") and "red: " in card and "heading" in card
    drawing = draw_start(stage, start, "a4")
    pose = start.task.scenes.poses[start.row][0]
    corners = outline_at(start.task.spec.checked.shapes[0], pose)
    drawn = [np.array(part.points)[:-1] for part in drawing.parts if isinstance(part, Stroke)]
    assert any(one.shape == corners.shape and np.allclose(one, corners) for one in drawn)
    assert np.allclose(corners.mean(axis=0), pose[:2]) and drawing.scale < 1.0


def test_every_thing_has_a_tag_that_fits_on_it(stage, suite):
    tags = [one.tag for one in stage.things]
    assert len(set(tags)) == len(tags) and min(tags) == 4
    for task in suite.tasks:
        for which, name in enumerate(task.spec.objects):
            thing = stage.thing(task.spec.checked, which)
            assert (
                thing.name.partition(" ")[0] == name and 1.25 * thing.side <= min(thing.shape.footprint.extent) + 1e-9
            )


def test_a_mat_of_too_many_pages():
    pytest.importorskip("fpdf")
    with pytest.raises(RequestError) as caught:
        write_pdf([PaperDrawing((0.0, 0.0), (10.0, 10.0), [], "a4", "large")])
    assert "10.0 x 10.0 m take 1,961 pages" in caught.value.diagnostics[0].text("help")


def test_a_step_that_is_no_grid(suite):
    with pytest.raises(RequestError) as caught:
        TableStage.from_suite(suite, 0.0)
    assert "out-of-range" in str(caught.value.diagnostics[0].kind.code)
