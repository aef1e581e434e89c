"""Pictures of scenes that differ in how many things there are: what is not there is not in them."""

import numpy as np
import pytest
from PIL import Image

import scenegen
from scenegen.scenes.stage import overlaps_of, poses_of, stage_of
from scenegen.show.figures.heatmap import heatmap
from scenegen.show.figures.sweep import sweep
from scenegen.show.render.files import FIRST

SPEC = "object block[1..2] = box(0.3, 0.3, 0.1), mug\nrequire noOverlap(objects)\ntask: leftOf(block[1], mug)\n"


@pytest.fixture(scope="module")
def scenes():
    return scenegen.sample(scenegen.parse(SPEC), (0.0, None), n=4, seed=1)


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_stage_is_as_large_as_what_is_there(scenes):
    file = scenes.file()
    assert (np.isnan(poses_of(file)[..., 0]) == ~scenes.present).all()
    stage = stage_of(file)
    assert all(map(np.isfinite, (*stage.table, stage.height)))
    assert overlaps_of(file) == [[]] * 4
    assert heatmap(file).startswith(b"\x89PNG")


@pytest.mark.long
def test_masks_show_what_is_there(scenes, tmp_path):
    scenes.render(tmp_path / "p", views=("top",), size=(120, 90), masks=True, workers=1)
    for number, here in enumerate(scenes.present):
        with Image.open(tmp_path / "p" / f"scene_000{number + 1}_top_mask.png") as picture:
            seen = set(np.unique(np.asarray(picture)).tolist())
        shown = {k for k in range(3) if k + FIRST in seen}
        assert shown == set(np.flatnonzero(here).tolist())


def test_a_sweep_keeps_the_number_of_things_of_the_hardest_scene(scenes):
    found, label = sweep(scenes, frames=3)
    hardest = int(scenes.phi["task"].argmin())
    assert label == "task" and not found.header.counts
    assert len(found.objects) == scenes.present[hardest].sum()
    assert (np.diff(found.phi["task"]) > 0.0).all()


@pytest.mark.long
def test_figures_take_them(scenes, tmp_path):
    (path, *_) = scenes[:2].figures(tmp_path, "topview")
    assert path.name == "scene_0001_topview.svg"
    assert ("block[2]" in path.read_text()) == scenes.present[0, 1]
