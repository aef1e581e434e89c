"""Figures from sets of scenes: sweeps that climb and keep the rules, top views, and requests that make no sense. What
notebooks show: pictures that are drawn when they are asked for, once, and never too many. `load_pybullet`: a scene
in a running PyBullet is the scene, and it stays as it is.
"""

import base64
import io
import re
import subprocess
import sys

import numpy as np
import pybullet
import pytest
from PIL import Image
from pybullet_utils.bullet_client import BulletClient

import scenegen
from scenegen.api.scenes import evaluate, requirement
from scenegen.errors import RequestError
from scenegen.pictures import notebook
from scenegen.pictures.figures.sweep import HARD_PHI, SOLVED_PHI, sweep
from scenegen.pictures.render import scenes as pictures
from scenegen.pictures.scenes import FIGURES, figures
from scenegen.things import asset_of
from tests.worlds.export.bullet import Bullet
from tests.worlds.export.worlds import library, tower

RULES = """object plate at (0.5, 0.3, 0), mug, fork, block
require noOverlap()
task: leftOf(fork, plate) & closeTo(fork, plate, 0.25) & aboveOf(mug, plate)
other: leftOf(block, plate)
"""


@pytest.fixture(scope="module")
def scenes():
    return scenegen.sample(scenegen.parse(RULES), phi={"task": (0.0, None)}, n=6, seed=2)


@pytest.mark.long
def test_a_sweep_climbs_evenly_keeps_the_rules_and_holds_what_is_fixed(scenes):
    spec = scenegen.parse(RULES).checked
    found, label = sweep(scenes, frames=12)
    phi = found.phi["task"]
    assert label == "task" and len(found) > 9
    assert (np.diff(phi) > 0).all() and phi[0] <= HARD_PHI and phi[-1] >= SOLVED_PHI - 0.003
    assert np.allclose(evaluate(spec, found)["task"], phi)
    assert (requirement(spec, found) >= 0.0).all()
    assert np.allclose(found.poses[:, 0], (0.5, 0.3, 0.0))
    steps = np.abs(np.diff(found.poses[:, :, :2], axis=0)).max()
    assert steps < 0.3  # one layout that moves, not twelve layouts
    again, _ = sweep(scenes, frames=12)
    assert np.array_equal(again.poses, found.poses)


def test_a_sweep_starts_at_a_hard_scene_of_the_set_if_there_is_one(scenes):
    hard = scenegen.sample(scenegen.parse(RULES), phi={"task": (-0.6, -0.3)}, n=5, seed=1)
    found, _ = sweep(hard, frames=6)
    assert any(np.array_equal(found.poses[0], poses) for poses in hard.poses)


def test_a_sweep_is_about_the_label_asked_for(scenes):
    found, label = sweep(scenes, "other", frames=5)
    assert label == "other" and (np.diff(found.phi["other"]) > 0).all()
    with pytest.raises(RequestError, match="did you mean `other`"):
        sweep(scenes, "othr")


@pytest.mark.long
def test_every_figure_is_made_and_named(scenes, tmp_path, monkeypatch):
    monkeypatch.setattr("scenegen.pictures.scenes.ANIMATION_SCENES", 4)
    kinds = [kind for kind in FIGURES if kind != "mp4"]  # tests/pictures/figures/test_figures.py
    made = scenes.figures(tmp_path / "figures", *kinds, size=(40, 30), workers=1)
    names = [path.name for path in made]
    assert names[:4] == ["contact_sheet.png", "sweep.png", "sweep.gif", "heatmap.png"]
    assert names[4:] == [f"scene_{number:04d}_topview.svg" for number in range(1, 7)]
    assert all(path.stat().st_size > 200 for path in made)
    assert {path.name for path in (tmp_path / "figures").iterdir()} == set(names)


def test_top_views_name_the_objects_and_the_atom_that_decides(scenes, tmp_path):
    (first, *_), atoms = (
        scenes.figures(tmp_path, "topview"),
        scenegen.api.scenes.explain(scenegen.parse(RULES).checked, scenes),
    )
    text = first.read_text()
    assert all(f">{name}<" in text for name in scenes.objects)
    assert f"{atoms['task'][0]} decides" in text.replace("&gt;", ">").replace("&lt;", "<")
    other = scenes.figures(tmp_path, "topview", label="other")[0].read_text()
    assert "other = " in other and "leftOf(block, plate)" in other


@pytest.mark.parametrize(
    ("kinds", "options", "words"),
    [
        (("sweeps",), {}, "did you mean `sweep`"),
        (("sheet",), {"view": "side"}, "unknown view `side`"),
        (("sheet",), {"size": (9, 9)}, "`size` is 9 x 9"),
        (("topview",), {"label": "nope"}, "no label `nope`"),
    ],
)
def test_requests_that_make_no_sense_write_nothing(scenes, tmp_path, kinds, options, words):
    with pytest.raises(RequestError, match=words):
        figures(scenes, tmp_path / "out", kinds, **options)
    assert not (tmp_path / "out").exists()


@pytest.fixture
def scenes_notebook():
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
def test_a_set_shows_a_sheet_and_draws_it_once(scenes_notebook, calls):
    assert calls == []
    page = scenes_notebook._repr_html_()
    (data,) = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    png = base64.b64decode(data)
    assert scenes_notebook._repr_html_() == page and Image.open(io.BytesIO(png)).format == "PNG"
    assert calls == [(3, (320, 240))]
    assert not hasattr(scenes_notebook, "_repr_png_")  # a notebook would store the sheet a second time
    assert "A mug &amp; a &lt;plate&gt;." in page and "<plate>" not in page
    assert "3 scenes of mug, plate" in page and "<td>0.1:</td>" in page
    assert f"<td>{scenes_notebook.phi['task'].min():+.4f}</td>" in page


@pytest.mark.long
def test_of_many_scenes_a_few_are_shown(scenes_notebook, calls, monkeypatch):
    assert notebook.NOTEBOOK_SCENES <= 16
    monkeypatch.setattr(notebook, "NOTEBOOK_SCENES", 2)
    many = scenes_notebook[np.arange(1000) % 3]
    page = many._repr_html_()
    assert calls == [(2, (320, 240))] and "the first 2 of 1,000 scenes" in page


@pytest.mark.long
def test_one_scene_is_one_picture(scenes_notebook, calls):
    assert Image.open(io.BytesIO(scenes_notebook[1]._repr_png_())).size == (32, 24)
    assert calls == [(1, (640, 480))]
    assert repr(scenes_notebook[1]).startswith("<Scene: mug (") and repr(scenes_notebook[1]).endswith(
        f"; phi task {scenes_notebook[1].phi['task']:.3g}>"
    )


def test_nothing_to_show(scenes_notebook, calls):
    none = scenes_notebook[:0]
    assert "<img" not in none._repr_html_() and "0 scenes" in none._repr_html_()
    assert calls == []


def test_what_cannot_be_drawn_is_said_not_raised(scenes_notebook):
    workspace = scenes_notebook.header.workspace.model_copy(update={"x": (1.0, 0.0)})
    broken = scenegen.SceneSet(
        scenes_notebook.poses, scenes_notebook.phi, scenes_notebook.header.model_copy(update={"workspace": workspace})
    )
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
    monkeypatch.setattr(notebook, "NOTEBOOK_LINES", 2)
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


@pytest.fixture
def bullet():
    made = Bullet()
    yield made
    pybullet.disconnect(physicsClientId=made.client)


def shifts(bullet, bodies, seconds=1.0):
    before = {name: bullet.frame(number)[0] for name, number in bodies.items()}
    pybullet.setGravity(0, 0, -9.81, physicsClientId=bullet.client)
    for _ in range(round(240 * seconds)):
        pybullet.stepSimulation(physicsClientId=bullet.client)
    return {name: np.linalg.norm(np.subtract(bullet.frame(bodies[name])[0], at)) for name, at in before.items()}


@pytest.mark.long
@pytest.mark.parametrize("number, mug", [(0, 0.007), (1, 0.0)])
def test_objects_are_where_the_scene_says(number, mug, bullet):
    scenes = tower()
    bodies = scenegen.load_pybullet(scenes[number], bullet.client)
    assert tuple(bodies) == scenes.objects
    for name, pose in scenes[number].poses.items():
        where, turned = bullet.frame(bodies[name])
        np.testing.assert_allclose([*where[:2], turned % (2 * np.pi)], [pose.x, pose.y, pose.theta], atol=1e-6)
    assert bullet.frame(bodies["mug"])[0][2] == pytest.approx(mug, abs=1e-6)


def test_mass_friction_and_what_is_held(bullet):
    bodies = scenegen.load_pybullet(tower()[0], bullet.client)
    info = {name: pybullet.getDynamicsInfo(one, -1, physicsClientId=bullet.client) for name, one in bodies.items()}
    assert info["mug"][0] == pytest.approx(asset_of("mug").mass) and info["tray"][0] == 0.0
    assert info["mug"][1] == pytest.approx(asset_of("mug").friction)
    np.testing.assert_allclose(info["block[1]"][2], asset_of("block").mass * 0.05**2 / 6)


def test_nothing_moves(bullet):
    assert max(shifts(bullet, scenegen.load_pybullet(tower()[0], bullet.client)).values()) < 2e-3


@pytest.mark.long
def test_the_whole_library_stands_still(bullet):
    moved = shifts(bullet, scenegen.load_pybullet(library()[0], bullet.client), 0.5)
    assert max(moved.values()) < 1e-3, moved


def test_without_the_table(bullet):
    floor = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=bullet.client)
    pybullet.createMultiBody(0.0, floor, physicsClientId=bullet.client)
    bodies = scenegen.load_pybullet(tower()[1], bullet.client, table=False)
    assert pybullet.getNumBodies(physicsClientId=bullet.client) == 1 + len(bodies)
    assert max(shifts(bullet, bodies).values()) < 2e-3


def test_clients_of_either_kind():
    client = BulletClient(pybullet.DIRECT)
    assert len(scenegen.load_pybullet(tower()[1], client)) == 5 == client.getNumBodies() - 1
    number = client._client
    del client
    with pytest.raises(scenegen.RequestError, match=f"PyBullet client {number} is not connected"):
        scenegen.load_pybullet(tower()[1], number)
