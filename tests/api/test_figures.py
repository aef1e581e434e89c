"""Figures from sets of scenes: sweeps that climb and keep the rules, top views, and requests that make no sense."""

import numpy as np
import pytest

import scenegen
from scenegen.api.scenes import evaluate, requirement
from scenegen.errors import RequestError
from scenegen.show.figures.sweep import DONE, HARD, sweep
from scenegen.show.scenes import FIGURES, figures

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
    assert (np.diff(phi) > 0).all() and phi[0] <= HARD and phi[-1] >= DONE - 0.003
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
    monkeypatch.setattr("scenegen.show.scenes.FRAMES", 4)
    kinds = [kind for kind in FIGURES if kind != "mp4"]  # tests/figures/test_video.py
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
