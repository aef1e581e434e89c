"""A support that is a choice, against scenes made without scenegen's formula: surfaces drawn first, then places. Where
phi jumps: cells without scenes are proved empty or found out together, and the others keep their scenes.
"""

import dataclasses
import math

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.api.scene_arrays import rows_of
from scenegen.api.scenes import evaluate
from scenegen.curriculum import TableTop
from scenegen.errors import DataError, RequestError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import gate
from scenegen.lang.spec import levels
from scenegen.learn.training.feed import whole_file
from scenegen.pictures.figures.sweep import sweep
from scenegen.pose import row_count
from scenegen.sampling.problem import Problem, make_problem
from scenegen.sampling.rejection import sampler, trial
from scenegen.sampling.rejection.trial import make_trial
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search import prune
from scenegen.search.effort import Budget
from scenegen.search.surfaces import worlds

SPEC = """region mat = rect(0.55, 0.1, 0.95, 0.3) at 20 cm
object tray, can[2] on any of [tray, mat, workspace]{}
task: closeTo(can[1], can[2], 40 cm)
"""


WEIGHTS = {"tray": 1, "mat": 2, "workspace": 5}


def by_hand(spec, count, by_area, weights, rng):
    """For both cans which surface they are on, (2, count), and x, y of both, (4, count); in the range."""
    tray, can = (spec.checked.shapes[which] for which in (0, 1))
    length, width = (size - 2.0 * can.footprint.radius for size in spec.checked.choices[1].options[0].outline.extent)
    assert length < tray.footprint.length and can.height > 0.0
    often = np.array([length * width, 0.4 * 0.2, 1.0]) if by_area else np.ones(3)
    often *= weights
    tries = 20 * count
    x, y, theta = rng.random(tries), rng.random(tries), rng.random(tries) * math.tau
    on, places = [], []
    for _ in range(2):
        chosen = rng.choice(3, size=tries, p=often / often.sum())
        u, v = (rng.random(tries) - 0.5) * length, (rng.random(tries) - 0.5) * width
        at_x = x + np.cos(theta) * u - np.sin(theta) * v, 0.55 + 0.4 * rng.random(tries), rng.random(tries)
        at_y = y + np.sin(theta) * u + np.cos(theta) * v, 0.1 + 0.2 * rng.random(tries), rng.random(tries)
        on.append(chosen)
        places += [np.choose(chosen, at_x), np.choose(chosen, at_y)]
    near = np.hypot(places[0] - places[2], places[1] - places[3]) <= 0.4
    return np.stack(on)[:, near][:, :count], np.stack(places)[:, near][:, :count]


WAYS = [(words, weights) for words in ("", " by area") for weights in ({}, WEIGHTS)]


@pytest.mark.long
@pytest.mark.parametrize(("words", "weights"), WAYS)
def test_choices_are_the_truth(words, weights):
    compare(words, weights, "rejection", 1000)


@pytest.mark.slow
@pytest.mark.parametrize(("words", "weights"), WAYS)
@pytest.mark.parametrize("method", ["rejection", "growth", "splitting"])
def test_choices_are_the_truth_by_all_methods(words, weights, method):
    compare(words, weights, method, 2000)


def compare(words, weights, method, count):
    """Surfaces by chi-square, places by Kolmogorov-Smirnov."""
    options = ", ".join(f"{name}: {weight}" for name, weight in weights.items())
    text = SPEC.format(words).replace("[tray, mat, workspace]", f"[{options or 'tray, mat, workspace'}]")
    spec, phi = scenegen.parse(text), {"task": (0.0, None)}
    scenes = scenegen.sample(spec, phi, count, seed=3, method=method, spread="base", workers=1, timeout=600.0)
    on, places = by_hand(spec, 8 * count, bool(words), [*weights.values()] or 1.0, np.random.default_rng(5))
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


KITCHEN = """workspace [-0.5, 0.5] x [-0.6, 0.6]
region place = rect(-0.05, -0.25, 0, -0.2)
object stove = box(0.15, 0.15, 0.03) at (-0.3, 0.3, 0 deg)
object bowl = bowl on any of [workspace, plate]
object plate = plate on place
require apart(stove, bowl) >= 0
require apart(bowl, plate) >= 0
goal: restsOn(bowl, plate, 4 mm) & dist(bowl, plate) <= 0.03 m
"""
HOUSE = """workspace [0, 5] x [0, 4]
region board = rect(0, 0, 1.2, 0.7) at 0.75 m
object cup[2] = cup on any of [workspace, board]
require apart(cup[1], cup[2]) >= 0
goal: restsOn(cup[1], board) & restsOn(cup[2], board)
"""


TOWER = """object a = block on any of [workspace, b]
object b = block on any of [workspace, c]
object c = block
require apart(a, b) >= 0
require apart(a, c) >= 0
require apart(b, c) >= 0
goal: restsOn(a, b) | restsOn(b, c)
"""


def problem_of(text: str, low: float, high: float, n: int = 50) -> Problem:
    return make_problem(check_text(text, "test.spec"), SampleRequest(n=n, seed=0, phi={"goal": Range(low, high)}))


@pytest.mark.parametrize("text", [KITCHEN, HOUSE])
def test_each_box_has_one_choice_and_together_they_are_the_whole(text: str) -> None:
    spec = check_text(text, "test.spec")
    lowest, highest = spec.box()
    low, high = worlds(gate(spec.core), lowest, highest)
    free = highest > lowest
    sizes = ((high - low)[free] / (highest - lowest)[free, None]).prod(axis=0)
    assert low.shape[1] == (2 if text == KITCHEN else 4)
    assert sizes.sum() == pytest.approx(1.0, abs=1e-6)
    assert np.isclose(low.min(axis=1), lowest).all() and np.isclose(high.max(axis=1), highest).all()


@pytest.mark.long
@pytest.mark.parametrize("text", [KITCHEN, HOUSE])
@pytest.mark.parametrize("ends", [(-0.3, 0.0), (-0.8, 0.1), (-0.02, 0.004)])
def test_no_cell_with_scenes_is_excluded(text: str, ends: tuple[float, float]) -> None:
    spec = scenegen.parse(text)
    cells = [scenegen.sample(spec, {"goal": one}, n=2000, seed=1) for one in ((None, 0.0), (0.0, None))]
    phi = np.concatenate([one.phi["goal"] for one in cells])
    try:
        problem = problem_of(text, *ends)
    except RequestError:
        assert not ((phi >= ends[0]) & (phi <= ends[1])).any()
        return
    rows = np.stack([phi, np.ones_like(phi)])  # the second is the requirement
    hit = set(problem.cells.find(rows).tolist()) - {-1}
    assert hit <= problem.possible


@pytest.mark.long
@pytest.mark.parametrize(("high", "code"), [(-0.01, "no-such-scene"), (0.0, "too-improbable")])
def test_what_phi_jumps_over_is_refused(high: float, code: str) -> None:
    """phi is 0 where a cup stands on the very border of the board: no search finds that, but no bounds rule it out."""
    with pytest.raises(RequestError) as raised:
        problem_of(HOUSE, -0.3, high)
    assert raised.value.diagnostics[0].code == code


@pytest.mark.parametrize("side", [0.01, 1.0, 100.0])
@pytest.mark.parametrize("wide", [1e-8, 1e-9])
def test_a_tight_equality_with_a_choice_of_surfaces_has_its_scenes(side: float, wide: float) -> None:
    text = f"""workspace [0, {side}] x [0, {side}]
region board = rect(0, 0, {side / 2}, {side / 2}) at 0.4 m
object a, b = cylinder({side / 100}, 0.01) on any of [workspace, board]
goal: abs(x(a) - {0.3 * side}) <= {wide}
"""
    scenes = scenegen.sample(scenegen.parse(text), (0.0, None), n=20)
    assert len(scenes.poses) == 20 and (scenes.phi["goal"] >= 0.0).all()


def test_a_value_that_many_scenes_share_stays_possible() -> None:
    """phi is 0.001 wherever both cups are well inside the board: at the very edge of the range."""
    assert problem_of(HOUSE, -0.5, 0.001).possible == {31}


@pytest.mark.long
def test_cells_that_are_served_together_have_their_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    """The trial is told to have missed half of the cells: they are then served from one cover, with the same scenes."""
    monkeypatch.setattr("scenegen.search.surfaces.stands_of", lambda *_: ())
    problem = problem_of(KITCHEN, -0.3, -0.19, 4000)
    plain = sampler.make_plan(problem, Budget())
    first = make_trial(problem, Budget())
    hits = first.hits.copy()
    hits[10:26] = 0
    monkeypatch.setattr(sampler, "SIFTING_WORK", 0.0)
    made = sampler.make_plan(problem, Budget(), dataclasses.replace(first, hits=hits))
    assert made.reachable == plain.reachable
    assert any(source.cells.sum() == 16 for source in made.sources)
    one, other = made.draw(0), plain.draw(0)
    for cell in (10, 17, 25):
        mine, its = one.rows[:, one.cell == cell], other.rows[:, other.cell == cell]
        assert min(mine.shape[1], its.shape[1]) > 50
        for row in np.flatnonzero(problem.highest > problem.lowest):
            assert stats.ks_2samp(mine[row], its[row]).pvalue > 1e-4
    assert np.array_equal(np.unique(problem.cells.find(one.phi)), np.unique(one.cell))


@pytest.mark.long
def test_a_cover_that_is_good_enough_has_the_same_scenes(monkeypatch: pytest.MonkeyPatch) -> None:
    """For a few scenes the cover is left as it is after the first split: it keeps 0.2 % of what is drawn, not 46 %."""
    monkeypatch.setattr(
        "scenegen.search.surfaces.stands_of", lambda *_: ()
    )  # blocks that are drawn where they stand need no splits
    few, many = (problem_of(TOWER, 0.0, 0.01, n) for n in (1, 1_000_000))
    plain = make_trial(few, Budget())
    monkeypatch.setattr("scenegen.sampling.rejection.trial.MIN_COVER_WORK", 0.0)
    early = make_trial(few, Budget())
    assert early.cover.acceptance < 0.1 * plain.cover.acceptance and early.work < plain.work
    assert make_trial(many, Budget()).cover.acceptance > 0.4, "for many scenes it is worth the work"

    def drawn(cover: prune.Cover, count: int, seed: int) -> np.ndarray:
        rows = np.empty((len(few.lowest), count))
        usable, _ = cover.draw(rows, np.random.default_rng(seed))
        return rows[:, usable & (few.cells.find(few.phi(rows)) >= 0)]

    one, other = drawn(early.cover, 600_000, 1), drawn(plain.cover, 4_000, 2)
    assert min(one.shape[1], other.shape[1]) > 500
    for row in np.flatnonzero(few.highest > few.lowest):
        assert stats.ks_2samp(one[row], other[row]).pvalue > 1e-4


@pytest.mark.long
def test_cells_that_no_candidate_hits_get_no_covers_of_their_own(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(KITCHEN, -0.3, -0.05)
    made: list[int] = []
    enough = trial._enough_for_cell

    def counted(of: Problem) -> tuple[float, float | None]:  # asked once for each cover of a cell
        made.append(1)
        return enough(of)

    monkeypatch.setattr(trial, "_enough_for_cell", counted)
    monkeypatch.setattr(sampler, "SIFTING_WORK", 0.0)
    plan = sampler.make_plan(problem, Budget())
    assert len(plan.reachable) == 16 and not made
    monkeypatch.setattr(sampler, "SIFTING_WORK", np.inf)
    assert sampler.make_plan(problem, Budget()).reachable == plan.reachable and made


@pytest.mark.parametrize("ends", [(0.0, None), (0.0, 0.0), (0.0, 0.1)])
@pytest.mark.parametrize(
    "text",
    [
        "region top = rect(0, 0, 0.5, 0.5) at 0.4 m\nobject a = block on any of [workspace, top]\ngoal: z(a) >= 0.4",
        "object a, b\ngoal: min(x(a), 0.2) >= 0.2",
    ],
)
def test_a_bound_that_many_scenes_reach_is_not_called_improbable(text: str, ends: tuple[float, float | None]) -> None:
    scenes = scenegen.sample(scenegen.parse(text), ends, n=20)
    assert (scenes.phi["goal"] == 0.0).all()
    assert "only-at-bound" not in [one.code for one in scenes.warnings]


def test_a_bound_that_single_scenes_reach_is_called_improbable() -> None:
    scenes = scenegen.sample(scenegen.parse("object a, b\ngoal: closeTo(a, b, 0)"), (0.0, None), n=20)
    assert "only-at-bound" in [one.code for one in scenes.warnings]
