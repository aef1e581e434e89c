"""Where episodes begin: the scenes of a reset, the same from the same seed, each once, and verified."""

import math

import numpy as np
import pytest
import torch
from gymnasium import error

import scenegen
from scenegen.curriculum import PhiBox, TableTop
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_SCENES, NO_TIME_TO_CHECK
from scenegen.learn.curriculum.library import SECONDS, SHORTLY, Sampler, forget
from scenegen.learn.curriculum.request import PhiRanges
from scenegen.learn.curriculum.strategies import strategy
from scenegen.sampling.request import Range

LEFT = "leftOf(mug, plate)"
TWO = "near: closeTo(mug, plate, 0.2)\nside: leftOf(mug, plate)"
APART = (
    "object mug = box(0.1, 0.1, 0.1)\nobject plate = box(0.1, 0.1, 0.1)\nrequire noOverlap()\ntask: leftOf(mug, plate)"
)


def starts(env, requests, seed=None):
    """Poses (n, 3N) and infos of the first scenes of episodes."""
    rows, infos = [], []
    for number, request in enumerate(requests):
        _, info = env.reset(seed=seed if number == 0 else None, options=request)
        rows.append(env.episodes.rows[:, 0].copy())
        infos.append(info)
    return np.array(rows), infos


def bands(count, low=-0.9, width=0.05, seed=0):
    ends = np.random.default_rng(seed).uniform(low, -width, count).tolist()
    return [{"phi": (end, end + width)} for end in ends]


def rescored(text, rows):
    spec = scenegen.parse(text)
    return spec.robustness()(torch.from_numpy(rows.reshape(len(rows), -1, 3))).numpy()


def test_scenes_have_the_phi_that_was_asked_for():
    requests = bands(300)
    rows, infos = starts(TableTop(LEFT), requests, seed=0)
    phi = rescored(LEFT, rows)[:, 0]
    ends = np.array([request["phi"] for request in requests])
    assert ((phi >= ends[:, 0] - 1e-12) & (phi <= ends[:, 1] + 1e-12)).all()
    assert [info["phi"]["task"] for info in infos] == pytest.approx(phi.tolist(), abs=1e-12)
    np.testing.assert_array_equal([info["task"]["task"] for info in infos], ends)


def test_the_same_seed_and_requests_give_the_same_scenes():
    requests = [*bands(150), *([{"phi": (-0.4, -0.39)}] * 150), *([None] * 50)]
    env = TableTop(LEFT)
    first, _ = starts(env, requests, seed=7)
    again, _ = starts(env, requests, seed=7)  # in an environment with a past
    other, _ = starts(TableTop(LEFT), requests, seed=7)
    np.testing.assert_array_equal(first, again)
    np.testing.assert_array_equal(first, other)
    assert (starts(env, requests, seed=8)[0] != first).any(axis=1).mean() > 0.98


def test_no_scene_comes_twice():
    narrow = [{"phi": (-0.4, -0.39)}] * 400  # far more than the library has
    rows, _ = starts(TableTop(LEFT), [*narrow, *bands(400), *([None] * 400), *narrow], seed=1)
    assert len(np.unique(rows, axis=0)) == len(rows)


def test_starts_are_even_over_a_band_also_after_part_of_it_was_used_up():
    env = TableTop(LEFT)
    starts(env, [{"phi": (-0.25, -0.2)}] * 500, seed=2)
    _, infos = starts(env, [{"phi": (-0.5, 0.0)}] * 1000)
    counts, _ = np.histogram([info["phi"]["task"] for info in infos], bins=10, range=(-0.5, 0.0))
    assert ((counts - 100.0) ** 2 / 100.0).sum() < 27.9  # chi-square, 9 degrees of freedom: one seed in a thousand


def test_without_a_request_all_that_is_not_satisfied():
    _, infos = starts(TableTop(LEFT), [None] * 300, seed=0)
    phi = np.array([info["phi"]["task"] for info in infos])
    assert phi.max() < 0.0 and phi.min() < -0.8 and (phi > -0.1).any()
    _, infos = starts(TableTop(LEFT, phi=(-0.2, -0.1)), [None] * 20, seed=0)
    assert all(-0.2 <= info["phi"]["task"] <= -0.1 for info in infos)


def test_labels_of_their_own_and_open_ends():
    requests = [{"phi": {"near": (-0.3, -0.2), "side": (0.1, None)}}] * 40
    _, infos = starts(TableTop(TWO), requests, seed=0)
    assert all(-0.3 <= one["phi"]["near"] <= -0.2 and one["phi"]["side"] >= 0.1 for one in infos)
    _, infos = starts(TableTop(TWO), [{"phi": PhiBox((-0.5, -0.2), (-0.1, 0.0))}] * 40)
    assert all(-0.5 <= one["phi"]["near"] <= -0.1 and -0.2 <= one["phi"]["side"] <= 0.0 for one in infos)
    _, infos = starts(TableTop(TWO), [{"phi": (-0.3, -0.2)}] * 40)
    assert all(-0.3 <= min(one["phi"]["near"], one["phi"]["side"]) <= -0.2 for one in infos)


def test_satisfied_starts_are_drawn_too():
    _, infos = starts(TableTop(LEFT), [{"phi": (0.2, 0.3)}] * 20, seed=0)
    assert all(0.2 <= info["phi"]["task"] <= 0.3 and info["is_success"] for info in infos)


def test_what_is_required_holds_at_the_start():
    rows, _ = starts(TableTop(APART), [None] * 200, seed=0)
    spec = scenegen.parse(APART.replace("require noOverlap()\ntask: leftOf(mug, plate)", "task: noOverlap()"))
    assert (spec.robustness()(torch.from_numpy(rows.reshape(len(rows), -1, 3))) >= 0).all()


@pytest.mark.parametrize("form", ["scene", "data", "poses", "mapping", "names", "array"])
def test_given_scenes(form):
    spec = scenegen.parse(LEFT)
    scene = scenegen.sample(spec, {"task": (-0.2, -0.1)}, 1, seed=3)[0]
    pose = {name: (one.x, one.y, one.theta) for name, one in scene.poses.items()}
    given = {
        "scene": scene,
        "data": scene.data(),
        "poses": scene.data().model_dump(),
        "mapping": pose,
        "names": {name: dict(zip(("x", "y", "theta"), one, strict=True)) for name, one in pose.items()},
        "array": np.array(list(pose.values())),
    }[form]
    env = TableTop(spec)
    _, info = env.reset(options={"scene": given})
    assert info["phi"] == pytest.approx(dict(scene.phi))
    np.testing.assert_array_equal(env.episodes.rows[:, 0].reshape(-1, 3), list(pose.values()))
    assert np.isinf(info["task"]["task"]).all()


def test_the_scenes_of_a_file(tmp_path):
    spec = scenegen.parse(LEFT)
    path = scenegen.sample(spec, {"task": (-0.5, -0.1)}, 40, seed=0).save(tmp_path / "s.json")
    known = {tuple(np.round(one, 12)) for one in scenegen.read_scenes(path).poses.reshape(40, -1)}
    rows, _ = starts(TableTop(spec, source=path), [None] * 500, seed=0)
    assert {tuple(np.round(row, 12)) for row in rows} == known
    _, infos = starts(TableTop(spec, source=path), [{"phi": (-0.3, -0.2)}] * 30, seed=0)
    assert all(-0.3 <= info["phi"]["task"] <= -0.2 for info in infos)


@pytest.mark.long
@pytest.mark.parametrize("text", [LEFT, TWO], ids=["one label", "two labels"])
def test_the_scenes_of_a_model(text, tmp_path):
    """With two labels to satisfy, the goal is a third one, which the model does not know."""
    spec, out = scenegen.parse(text), tmp_path / "m.safetensors"
    model = scenegen.train(spec, "gan", recipe="paper", out=out, epochs=1, scenes=64, card=False)
    env = TableTop(spec, source=model)
    rows, infos = starts(env, [{"phi": (-0.3, -0.1)}] * 20, seed=0)
    phi = rescored(text, rows).min(axis=1)
    assert ((phi >= -0.3) & (phi <= -0.1)).all()
    assert list(infos[0]["phi"].values())[-1] == pytest.approx(phi[0])


@pytest.mark.slow
def test_the_scenes_of_a_model_file(tmp_path):
    scenegen.train(scenegen.parse(LEFT), "energy", out=tmp_path / "m.safetensors", epochs=1, scenes=2000)
    rows, _ = starts(TableTop(LEFT, source=tmp_path / "m.safetensors"), [{"phi": (-0.3, -0.1)}] * 20, seed=0)
    phi = rescored(LEFT, rows)[:, 0]
    assert ((phi >= -0.3) & (phi <= -0.1)).all()


def test_a_task_that_reaches_a_bit_too_far_is_met_as_far_as_it_can_be():
    env = TableTop(LEFT)
    box = PhiBox((env.space.low[0] - 1e-3,), (0.0,))
    _, infos = starts(env, [{"phi": box, "nearest": True}] * 50, seed=0)
    phi = [info["phi"]["task"] for info in infos]
    assert min(phi) < -0.7 and max(phi) > -0.2


@pytest.mark.long
def test_tasks_in_several_labels_take_few_draws():
    env = TableTop(TWO)
    low, high = (np.array(ends) for ends in (env.space.low, env.space.high))
    rng = np.random.default_rng(0)
    away = []
    env.reset(seed=0)
    for _ in range(300):
        corner = low + rng.random(2) * 0.8 * (high - low)
        box = PhiBox(tuple(corner.tolist()), tuple((corner + 0.2 * (high - low)).tolist()))
        _, info = env.reset(options={"phi": box, "nearest": True})
        phi = np.array([info["phi"]["near"], info["phi"]["side"]])
        away.append(np.maximum(np.maximum(corner - phi, phi - corner - 0.2 * (high - low)), 0.0).max())
    assert env.episodes._streams[0]._draws.total() <= 20  # 300 without a supply; about 6, more where time is short
    assert np.mean(np.array(away) == 0.0) > 0.6  # the others are out of reach, or in the next cell


def test_the_nearest_scenes_where_a_task_is_out_of_reach():
    _, infos = starts(TableTop(LEFT), [{"phi": (-3.0, -2.0), "nearest": True}] * 5, seed=0)
    assert all(-1.0 < info["phi"]["task"] < -0.9 for info in infos)
    # a mug near the plate is not 80 cm beside it
    box = PhiBox((-0.01, -0.9), (0.0, -0.8))
    _, infos = starts(TableTop(TWO), [{"phi": box, "nearest": True}] * 5, seed=0)
    assert all(info["phi"]["side"] < -0.1 for info in infos)
    point = PhiBox((-0.3,), (-0.3,))
    _, infos = starts(TableTop(LEFT), [{"phi": point, "nearest": True}] * 5, seed=0)
    assert all(-0.34 < info["phi"]["task"] < -0.26 for info in infos)


@pytest.mark.parametrize("text", [LEFT, TWO], ids=["one label", "two labels"])
def test_where_the_nearest_will_do_there_is_always_a_scene(text, monkeypatch):
    """However slow sampling is: the library's scenes serve again."""
    forget()
    env = TableTop(text)
    env.reset(seed=0)
    waited = []

    def no_time(self, ranges, n, seed, spread="flat", patience=SECONDS):
        waited.append(patience)
        raise RequestError(NO_SCENES())

    monkeypatch.setattr(Sampler, "draw", no_time)
    low, high = (np.array(ends) for ends in (env.space.low, env.space.high))
    box = PhiBox(tuple((low + 0.31 * (high - low)).tolist()), tuple((low + 0.39 * (high - low)).tolist()))
    away = []
    for _ in range(400):
        _, info = env.reset(options={"phi": box, "nearest": True})
        phi = np.array([info["phi"][label] for label in env.rules.target.names[: len(low)]])
        away.append(np.maximum(np.maximum(box.low - phi, phi - box.high), 0.0) / (high - low))
    assert np.max(away) < 0.25 and len(waited) < 20 and set(waited) == {SHORTLY}
    with pytest.raises(error.InvalidBound, match=r"\[no-scenes\]"):
        for _ in range(400):
            env.reset(options={"phi": box})
    forget()


def test_a_cell_overlaps_with_itself_alone():
    index = TableTop(TWO).starts.library.index((0, 1))
    for cell in range(len(index.members)):
        low, high = index.low[cell], index.high[cell]
        whole = PhiRanges((*low.tolist(), -math.inf), (*high.tolist(), math.inf))
        assert index.overlap(whole)[0] == [cell]


@pytest.mark.long
def test_a_curriculum_ends_where_the_goal_is():
    """Though most unsatisfied scenes are far from it, and some labels are hardly ever violated."""
    rare = "task: leftOf(mug, plate)\nsafe: !closeTo(mug, plate, 0.01)"
    space = TableTop(f"object mug, plate\n{rare}").space
    assert space.high[0] == 0.0 and space.low[1] < space.high[1]
    chain = " & ".join(f"closeTo({a}, {b}, 0.05)" for a, b in ("ab", "bc", "cd"))
    space = TableTop(f"object a, b, c, d\none: {chain}\ntwo: leftOf(a, d)").space
    assert space.high == (0.0, 0.0) and space.low[0] < -0.8
    for name in ("uniform", "self_paced", "learnability"):
        assert strategy(name, space, np.random.default_rng(0)).next_task().low[0] >= space.low[0]


def test_draws_that_take_too_long_say_what_helps(monkeypatch):
    def late(*given, **options):
        raise RequestError(NO_TIME_TO_CHECK())

    sampler = Sampler(TableTop(LEFT).rules.target)
    monkeypatch.setattr("scenegen.learn.curriculum.library.draw_scenes", late)
    with pytest.raises(RequestError, match=r"a draw has 3 s here(.|\n)*give them as `source`"):
        sampler.draw({"task": Range(0.1, 0.2)}, 1000, 0, patience=3.0)
