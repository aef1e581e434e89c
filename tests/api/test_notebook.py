"""What notebooks show: pictures that are drawn when they are asked for, once, and never too many."""

import base64
import io
import re
import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

import scenegen
from scenegen.show import notebook
from scenegen.show.render import scenes as pictures


@pytest.fixture
def scenes():
    text = "# A mug & a <plate>.\nobject mug, plate\ntask: leftOf(mug, plate)"
    return scenegen.sample(scenegen.parse(text), {"task": (0.1, None)}, n=3, seed=2)


@pytest.fixture
def calls(monkeypatch):
    """What was drawn: (scenes, size) of each call. The pictures themselves are small."""
    made = []
    draw = pictures.render_scenes

    def spy(file, out, **options):
        made.append((len(file.scenes), options["size"]))
        return draw(file, out, **options | {"size": (32, 24), "workers": 1})

    monkeypatch.setattr(pictures, "render_scenes", spy)
    return made


@pytest.mark.long
def test_a_set_shows_a_sheet_and_draws_it_once(scenes, calls):
    assert calls == []
    page = scenes._repr_html_()
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    png = base64.b64decode(data)
    assert scenes._repr_html_() == page and Image.open(io.BytesIO(png)).format == "PNG"
    assert calls == [(3, (320, 240))]
    assert not hasattr(scenes, "_repr_png_")  # a notebook would store the sheet a second time
    assert "A mug &amp; a &lt;plate&gt;." in page and "<plate>" not in page
    assert "3 scenes of mug, plate" in page and "<td>0.1:</td>" in page
    assert f"<td>{scenes.phi['task'].min():+.4f}</td>" in page


@pytest.mark.long
def test_of_many_scenes_a_few_are_shown(scenes, calls, monkeypatch):
    assert notebook.SHOWN <= 16
    monkeypatch.setattr(notebook, "SHOWN", 2)
    many = scenes[np.arange(1000) % 3]
    page = many._repr_html_()
    assert calls == [(2, (320, 240))] and "the first 2 of 1,000 scenes" in page


@pytest.mark.long
def test_one_scene_is_one_picture(scenes, calls):
    assert Image.open(io.BytesIO(scenes[1]._repr_png_())).size == (32, 24)
    assert calls == [(1, (640, 480))]
    assert repr(scenes[1]).startswith("<Scene: mug (") and repr(scenes[1]).endswith(
        f"; phi task {scenes[1].phi['task']:.3g}>"
    )


def test_nothing_to_show(scenes, calls):
    none = scenes[:0]
    assert "<img" not in none._repr_html_() and "0 scenes" in none._repr_html_()
    assert calls == []


def test_what_cannot_be_drawn_is_said_not_raised(scenes):
    workspace = scenes.header.workspace.model_copy(update={"x": (1.0, 0.0)})
    broken = scenegen.SceneSet(scenes.poses, scenes.phi, scenes.header.model_copy(update={"workspace": workspace}))
    page = broken._repr_html_()
    assert "<img" not in page and "<pre>error[size-in-file]: the workspace is empty" in page
    assert broken[0]._repr_png_() is None


def test_a_spec_shows_its_formulas_as_trees(monkeypatch):
    text = "# <b>Tea</b>.\nobject mug, plate\nrequire noOverlap()\n"
    text += "task: leftOf(mug, plate) & (inside(mug, plate) | aboveOf(mug, plate))"
    page = scenegen.parse(text)._repr_html_()
    assert "&lt;b&gt;Tea&lt;/b&gt;." in page and "<b>Tea" not in page and "objects: mug, plate" in page
    assert "<b>task</b>" in page and "<b>require</b>" in page
    texts = re.findall(r'<td style="padding-left: ([0-9.]+)em; text-align: left">([^<]*)</td>', page)
    assert texts[:2] == [("0.5", "all of"), ("2", "leftOf(mug, plate)")]
    assert ("2", "one of") in texts and ("3.5", "aboveOf(mug, plate)") in texts
    assert "[-1, 1] m" in page
    monkeypatch.setattr(notebook, "LINES", 2)
    assert "and 3 more" in scenegen.parse(text)._repr_html_()


def test_words_of_a_set_of_many_objects():
    objects = scenegen.parse("object block[40]\ntask: leftOf(block[1], block[2])")
    assert "block[10] and 30 more; phi task" in repr(scenegen.sample(objects, n=2))


@pytest.mark.long
def test_nothing_heavy_is_loaded_before_it_is_shown():
    program = """
import sys, scenegen
scenes = scenegen.sample(scenegen.parse("leftOf(mug, plate)"), n=1)
repr(scenes), scenes[0], scenes[:1]
print(*sorted({'pybullet', 'PIL', 'pandas', 'trimesh'} & set(sys.modules)))
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.strip() == ""
