"""A support that is a choice, against scenes made without scenegen's formula: surfaces drawn first, then places."""

import math

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import evaluate
from scenegen.curriculum import TableTop
from scenegen.errors import DataError, RequestError
from scenegen.lang.spec import levels
from scenegen.learn.training.feed import whole_file
from scenegen.pose import row_count
from scenegen.show.figures.sweep import sweep

SPEC = """region mat = rect(0.55, 0.1, 0.95, 0.3) at 20 cm
object tray, can[2] on any of [tray, mat, workspace]{}
task: closeTo(can[1], can[2], 40 cm)
"""


def by_hand(spec, count, by_area, rng):
    """For both cans which surface they are on, (2, count), and x, y of both, (4, count); in the range."""
    tray, can = (spec.checked.shapes[which] for which in (0, 1))
    length, width = (size - 2.0 * can.footprint.radius for size in spec.checked.choices[1].options[0].outline.extent)
    assert length < tray.footprint.length and can.height > 0.0
    areas = np.array([length * width, 0.4 * 0.2, 1.0])
    tries = 20 * count
    x, y, theta = rng.random(tries), rng.random(tries), rng.random(tries) * math.tau
    on, places = [], []
    for _ in range(2):
        chosen = rng.choice(3, size=tries, p=areas / areas.sum() if by_area else None)
        u, v = (rng.random(tries) - 0.5) * length, (rng.random(tries) - 0.5) * width
        at_x = x + np.cos(theta) * u - np.sin(theta) * v, 0.55 + 0.4 * rng.random(tries), rng.random(tries)
        at_y = y + np.sin(theta) * u + np.cos(theta) * v, 0.1 + 0.2 * rng.random(tries), rng.random(tries)
        on.append(chosen)
        places += [np.choose(chosen, at_x), np.choose(chosen, at_y)]
    near = np.hypot(places[0] - places[2], places[1] - places[3]) <= 0.4
    return np.stack(on)[:, near][:, :count], np.stack(places)[:, near][:, :count]


@pytest.mark.long
@pytest.mark.parametrize("words", ["", " by area"])
def test_choices_are_the_truth(words):
    compare(words, "rejection", 1000)


@pytest.mark.slow
@pytest.mark.parametrize("words", ["", " by area"])
@pytest.mark.parametrize("method", ["rejection", "growth", "splitting"])
def test_choices_are_the_truth_by_all_methods(words, method):
    compare(words, method, 2000)


def compare(words, method, count):
    """Surfaces by chi-square, places by Kolmogorov-Smirnov."""
    spec, phi = scenegen.parse(SPEC.format(words)), {"task": (0.0, None)}
    scenes = scenegen.sample(spec, phi, count, seed=3, method=method, spread="base", workers=1, timeout=600.0)
    on, places = by_hand(spec, 8 * count, bool(words), np.random.default_rng(5))
    counted = int(count * scenes.header.sampler.get("effective_share", 1.0))
    mine, true = (np.bincount(one[0] * 3 + one[1], minlength=9) for one in (scenes.on[:counted].T.astype(int) - 1, on))
    kept = mine + true > 8
    assert stats.chi2_contingency(np.stack([mine, true])[:, kept]).pvalue > 0.002
    found = scenes.poses[:counted, 1:, :2].reshape(counted, 4).T
    assert min(stats.ks_2samp(one, other).pvalue for one, other in zip(found, places, strict=True)) > 0.002


@pytest.fixture(scope="module")
def scenes():
    spec = scenegen.parse(SPEC.format("") + "high: z(can[1]) - top(can[2]) >= 5 cm")
    return spec, scenegen.sample(spec, {"task": (0.0, None)}, 40, seed=1, workers=1)


@pytest.mark.long
def test_phi_is_that_of_the_surfaces(scenes):
    spec, found = scenes
    tray = spec.checked.choices[1].options[0].height
    bottoms = np.array([tray, 0.2, 0.0])[found.on.astype(int) - 1]
    height = spec.checked.shapes[1].height
    assert found.phi["high"] == pytest.approx(bottoms[:, 0] - bottoms[:, 1] - height - 0.05)
    assert found.poses7()[:, 1:, 2] == pytest.approx(bottoms)


@pytest.mark.parametrize("ending", ["json", "jsonl", "parquet"])
def test_files_say_on_what_objects_stand(scenes, tmp_path, ending):
    spec, found = scenes
    again = scenegen.read_scenes(found.save(tmp_path / f"scenes.{ending}"))
    assert (again.poses == found.poses).all() and (again.on == found.on).all()
    values = evaluate(spec.checked, again)
    assert all((values[name] == found.phi[name]).all() for name in spec.labels)
    assert (again[3:5].on == found.on[3:5]).all()
    names = [one.on for one in found.header.choosers[0].support.any]
    assert names == ["tray.inside", "mat", "workspace"]
    assert found[0].poses["can[1]"].on == names[int(found.on[0, 0]) - 1]


@pytest.mark.long
def test_a_stream_has_the_same_scenes(scenes, tmp_path):
    spec, found = scenes
    scenegen.sample_to(tmp_path / "a.jsonl", spec, {"task": (0.0, None)}, 40, seed=1, workers=2)
    found.save(tmp_path / "b.jsonl")
    assert (tmp_path / "a.jsonl").read_bytes() == (tmp_path / "b.jsonl").read_bytes()


@pytest.mark.long
def test_a_fixed_object_keeps_its_choice(scenes):
    spec, _ = scenes
    held = scenegen.sample(spec, {"task": (0.0, None)}, 150, fix={"can[1]": (0.7, 0.2)}, workers=1)
    assert (held.poses[:, 1, :2] == (0.7, 0.2)).all() and set(held.on[:, 0]) >= {2.0, 3.0}


def test_what_has_no_place_for_a_choice_says_so(scenes):
    spec, _ = scenes
    with pytest.raises(RequestError) as refused:
        spec.robustness()
    assert refused.value.diagnostics[0].code == "choices-not-here"


def test_a_sweep_leaves_everything_on_its_surface(scenes):
    spec, found = scenes
    swept, label = sweep(found, "task", 4)
    assert label == "task" and len(swept) > 1 and (swept.on == swept.on[0]).all()
    values = evaluate(spec.checked, swept)
    assert all((values[name] == swept.phi[name]).all() for name in spec.labels)
    assert (np.diff(swept.phi["task"]) > 0.0).all()


def test_heights_follow_the_switches(scenes):
    spec, found = scenes
    assert levels(spec.checked, rows_of(spec.checked, found)) == pytest.approx(found.poses7()[..., 2])


def test_training_scenes_of_a_file_have_the_choice(scenes, tmp_path):
    spec, found = scenes
    data = whole_file(spec.checked, found.save(tmp_path / "scenes.parquet"), None)
    assert data.rows.shape == (row_count(len(spec.checked.core.objects)), len(found))
    assert data.phi[0].numpy() == pytest.approx(found.phi["task"], abs=1e-5)
    assert data.phi[1].numpy() == pytest.approx(found.phi["high"], abs=1e-5)


@pytest.mark.slow
def test_a_model_makes_the_choice(tmp_path):
    """Each scene is verified; the shares of the surfaces are about those of exact scenes."""
    spec, phi = scenegen.parse(SPEC.format("")), {"task": (0.0, 0.3)}
    data = scenegen.sample(spec, {"task": (-0.3, 0.4)}, 12_000, seed=5, workers=1).save(tmp_path / "d.parquet")
    model = scenegen.train(spec, out=tmp_path / "m.safetensors", epochs=15, data=str(data))
    assert model.trained.model.layout.branches == 9
    made = scenegen.sample(model, phi, 600, seed=1, workers=1)
    true = scenegen.sample(spec, phi, 600, seed=2, workers=1)
    assert all((evaluate(spec.checked, made)[name] == made.phi[name]).all() for name in spec.labels)
    assert made.phi["task"].min() >= 0.0 and made.phi["task"].max() <= 0.3
    shares = [np.bincount((3 * one.on[:, 0] + one.on[:, 1] - 4).astype(int), minlength=9) / 600 for one in (made, true)]
    assert abs(shares[0] - shares[1]).sum() / 2.0 < 0.25  # by chance 0.06


def test_environments_see_the_choice(scenes):
    spec, found = scenes
    env = TableTop(spec, goal="task", source=found)
    seen, _ = env.reset(seed=1, options={"phi": (0.0, 0.4)})
    assert env.views.names[-2:] == ("can[1].on", "can[2].on")
    places = list(env.views.on_numbers.values())
    assert places == [-1.0, 0.0, 1.0] and set(seen[-2:].tolist()) <= set(places)
    again, info = env.reset(options={"scene": found[3]})
    on = [places[int(one) - 1] for one in found.on[3]]
    assert again[-2:].tolist() == on and info["phi"]["task"] == pytest.approx(found.phi["task"][3])


def test_a_surface_is_seen_as_the_same_number_under_every_object():
    """Whichever lists name it, in whichever order, and however large it is."""
    spec = scenegen.parse(
        "object coaster = cylinder(9 cm, 1 cm), mug on any of [coaster, workspace],"
        " can on any of [workspace, coaster] by area\ntask: closeTo(mug, can, 50 cm)"
    )
    made = scenegen.sample(spec, {"task": (0.0, None)}, 200, seed=2, workers=1)
    env = TableTop(spec, goal="task", source=made)
    assert env.views.names[-2:] == ("mug.on", "can.on")
    assert env.views.on_numbers == {"coaster.top": -1.0, "workspace": 1.0}
    met = set()
    for scene in made:
        seen, _ = env.reset(options={"scene": scene})
        under = [scene.poses[name].on for name in ("mug", "can")]
        assert seen[-2:].tolist() == [env.views.on_numbers[one] for one in under]
        met.add(tuple(under))
    assert len(met) >= 3


def test_scenes_without_the_choice_are_refused(scenes):
    spec, _ = scenes
    plain = scenegen.parse("object tray, can[2]\ntask: closeTo(can[1], can[2], 40 cm)")
    other = scenegen.sample(plain, {"task": (0.0, None)}, 2, workers=1)
    with pytest.raises(DataError) as refused:
        evaluate(spec.checked, other)
    assert refused.value.diagnostics[0].code == "no-surface-given"
