"""scenegen/TableTop-v0: what a step does, what it pays, and what gymnasium and Stable-Baselines3 think of it. Where
episodes begin: the scenes of a reset, the same from the same seed, each once, and verified. Environments of specs
that draw how many things there are: absent objects are zeros, and `present` says so. render() draws the scene as it
is, with a process that stays.
"""

import math
import warnings

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import error
from gymnasium.utils.env_checker import check_env
from stable_baselines3.common.env_checker import check_env as check_env_sb3

import scenegen
from scenegen.curriculum import PhiBox, TableTop, TableTopVector
from scenegen.errors import RequestError
from scenegen.errors.requests import NO_SCENES, NO_TIME_TO_CHECK
from scenegen.play.environments.library import DRAW_PATIENCE, Sampler, forget
from scenegen.play.environments.request import PhiRanges
from scenegen.play.environments.stream import SHORT_PATIENCE
from scenegen.play.strategies import strategy
from scenegen.sampling.request import Range

LEFT = "leftOf(mug, plate)"
KNIFE = "angle(knife, NORTH, 0.2) & leftOf(knife, plate)"
APART = (
    "object mug = box(0.1, 0.1, 0.1)\nobject plate = box(0.1, 0.1, 0.1)\nrequire noOverlap()\ntask: leftOf(mug, plate)"
)
TWO = "near: closeTo(mug, plate, 0.2)\nside: leftOf(mug, plate)"
HELD = "object mug\nobject plate at (0.5, 0.5)\ntask: leftOf(mug, plate)"


def begin(spec, scene, **settings):
    env = TableTop(spec, **settings)
    seen, info = env.reset(options={"scene": scene})
    return env, seen, info


@pytest.mark.parametrize("moves", ["grid", "continuous"])
@pytest.mark.parametrize("spec", [LEFT, KNIFE, APART, TWO, HELD], ids=["plain", "heading", "require", "two", "held"])
def test_the_checkers_have_nothing_to_say(spec, moves):
    settings = {"spec": spec, "moves": moves, "reward": "dense"}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make("scenegen/TableTop-v0", **settings)
        check_env(env.unwrapped, skip_render_check=True)
        check_env_sb3(gymnasium.make("scenegen/TableTop-v0", **settings))


def test_the_name_brings_the_module_along():
    env = gymnasium.make("scenegen.curriculum:scenegen/TableTop-v0", spec=LEFT)
    assert env.spec.id == "scenegen/TableTop-v0" and env.spec.max_episode_steps == 100


def test_an_episode_by_hand():
    env, seen, info = begin(LEFT, {"mug": (0.62, 0.5, 1.0), "plate": (0.5, 0.25, 0.0)})
    assert env.moves.names == tuple(
        f"{name} {way}" for name in ("mug", "plate") for way in ("x +", "x -", "y +", "y -")
    )
    assert env.views.names == ("mug.x", "mug.y", "plate.x", "plate.y")
    np.testing.assert_allclose(seen, [0.24, 0.0, 0.0, -0.5], atol=1e-6)
    assert info["phi"] == pytest.approx({"task": -0.12}) and info["is_success"] is False
    paid = []
    for action in (1, 6, 1, 1):
        seen, reward, terminated, truncated, info = env.step(action)
        paid.append((reward, terminated))
        assert truncated is False
    assert paid == [(0.0, False), (0.0, False), (0.0, False), (10.0, True)]
    assert info["phi"] == pytest.approx({"task": 0.03}) and info["is_success"] is True
    np.testing.assert_allclose(seen, [-0.06, 0.0, 0.0, -0.4], atol=1e-6)


def test_off_the_table():
    env, _, _ = begin(LEFT, {"mug": (0.98, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)})
    seen, reward, terminated, _, info = env.step(0)
    assert (reward, terminated, info["off_table"], info["is_success"]) == (-10.0, True, True, False)
    assert seen[0] == 1.0
    # what leaves the table has not reached the goal, whatever phi says
    env, _, _ = begin("leftOf(mug, plate) & aboveOf(mug, plate)", {"mug": (0.48, 0.98, 0), "plate": (0.5, 0.99, 0)})
    _, reward, terminated, _, info = env.step(2)
    assert (reward, terminated, info["is_success"]) == (-10.0, True, False)


def test_the_edge_is_still_the_table():
    env, _, _ = begin("rightOf(mug, plate) & !closeTo(mug, plate, 2)", {"mug": (0.1, 0.5, 0), "plate": (0.5, 0.5, 0)})
    for _ in range(18):  # twenty times 0.05 is not 1 for computers
        _, _, terminated, _, _ = env.step(0)
        assert not terminated
    assert env.step(0)[2]


def test_headings_turn_where_phi_depends_on_them():
    env, seen, _ = begin(KNIFE, {"knife": (0.2, 0.5, 0.05), "plate": (0.5, 0.5, 2.0)})
    assert env.views.names == ("knife.x", "knife.y", "knife.cos", "knife.sin", "plate.x", "plate.y")
    np.testing.assert_allclose(seen[2:4], [math.cos(0.05), math.sin(0.05)], atol=1e-6)
    plus, minus = (env.moves.names.index(f"knife theta {sign}") for sign in "+-")
    env.step(minus)  # through 0
    for _ in range(5):
        *_, info = env.step(plus)
    assert info["is_success"]
    assert not any("theta" in name for name in TableTop(LEFT).moves.names)


def test_a_move_that_breaks_what_is_required_is_not_made():
    env, before, _ = begin(APART, {"mug": (0.62, 0.5, 0), "plate": (0.5, 0.5, 0)}, moves="continuous", step=0.05)
    seen, reward, terminated, _, info = env.step([-1.0, 0.0, 0.0, 0.0])
    assert info["blocked"] and not terminated and reward == 0.0
    np.testing.assert_array_equal(seen, before)
    *_, info = env.step([0.0, 1.0, 0.0, 0.0])
    assert not info["blocked"]


def test_continuous_moves_are_in_units_of_step_and_turn():
    scene = {"knife": (0.2, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)}
    env, _, _ = begin(KNIFE, scene, moves="continuous", move="knife", step=0.1, turn=0.5)
    assert env.moves.names == ("knife x", "knife y", "knife theta")
    seen, *_ = env.step(np.array([0.5, -1.0, 0.2], dtype=np.float32))
    np.testing.assert_allclose(seen[:4], [-0.5, -0.2, math.cos(0.1), math.sin(0.1)], atol=1e-6)


def test_dense_rewards_add_up_to_what_phi_gained():
    env, _, info = begin(LEFT, {"mug": (0.9, 0.5, 0.0), "plate": (0.5, 0.5, 0.0)}, reward="dense", step=0.1)
    first, total = info["phi"]["task"], 0.0
    for action in (1, 2, 1, 1, 1, 1):
        _, reward, over, _, info = env.step(action)
        total += reward
    assert over and total == pytest.approx(10.0 + (info["phi"]["task"] - first) / 0.1)


def test_all_labels_are_the_goal_unless_one_is_named():
    scene = {"mug": (0.4, 0.5, 0.0), "plate": (0.9, 0.5, 0.0)}
    env, _, info = begin(TWO, scene, step=0.35)
    assert list(info["phi"]) == ["near", "side", "near & side"]
    assert info["phi"]["near & side"] == info["phi"]["near"] < 0.0 < info["phi"]["side"]
    assert env.step(0)[4]["is_success"]
    _, _, info = begin(TWO, scene, goal="side")
    assert list(info["phi"]) == ["near", "side"] and info["is_success"]


def test_held_objects_stay():
    env = TableTop(HELD)
    env.reset(seed=0)
    assert all(name.startswith("mug ") for name in env.moves.names) and env.views.names == ("mug.x", "mug.y")


def test_phi_and_observations_are_those_of_the_scene():
    spec = scenegen.parse(KNIFE)
    env = TableTop(spec, moves="continuous")
    env.action_space.seed(0)
    env.reset(seed=0)
    for _ in range(20):
        _, _, over, _, info = env.step(env.action_space.sample())
        poses = env.episodes.rows.T.reshape(1, -1, 3)
        exact = float(spec.robustness()(torch.from_numpy(poses))[0, 0])
        assert info["phi"]["task"] == pytest.approx(exact, abs=1e-12)
        if over:
            break


def test_a_curriculum_goes_from_hard_to_satisfied():
    space = TableTop(LEFT).space
    assert isinstance(space, PhiBox) and space.high == (0.0,) and -1.0 < space.low[0] < -0.9


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
    model = scenegen.train(spec, "gan", data="uniform", out=out, epochs=1, scenes=64, card=False)
    env = TableTop(spec, source=model)
    rows, infos = starts(env, [{"phi": (-0.3, -0.1)}] * 20, seed=0)
    phi = rescored(text, rows).min(axis=1)
    assert ((phi >= -0.3) & (phi <= -0.1)).all()
    assert list(infos[0]["phi"].values())[-1] == pytest.approx(phi[0])


@pytest.mark.slow
def test_the_scenes_of_a_model_file(tmp_path):
    scenegen.train(scenegen.parse(LEFT), "flow", out=tmp_path / "m.safetensors", epochs=1, scenes=2000)
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

    def no_time(self, ranges, n, seed, spread="flat", patience=DRAW_PATIENCE):
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
    assert np.max(away) < 0.25 and len(waited) < 20 and set(waited) == {SHORT_PATIENCE}
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
    monkeypatch.setattr("scenegen.play.environments.library.draw_scenes", late)
    with pytest.raises(RequestError, match=r"a draw has 3 s here(.|\n)*give them as `source`"):
        sampler.draw({"task": Range(0.1, 0.2)}, 1000, 0, patience=3.0)


NAME = "scenegen.curriculum:scenegen/TableTop-v0"
SPEC = "object block[1..3], mug\nrequire x(mug) >= 0.2\ntask: forall b in block: leftOf(b, mug)\nsafe: y(mug) >= 0.1\n"


@pytest.fixture(scope="module")
def env():
    return gymnasium.make(NAME, spec=SPEC)


def numbers(seen, names):
    return 1 + int(sum(value for value, name in zip(seen, names, strict=True) if name.endswith(".present")))


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_absent_objects_are_zeros_and_cannot_be_moved(env):
    names = env.unwrapped.views.names
    assert [name for name in names if name.endswith(".present")] == ["block[2].present", "block[3].present"]
    found = set()
    for seed in range(12):
        seen, info = env.reset(seed=seed, options={"phi": {"task": (-0.4, -0.1)}})
        assert env.observation_space.contains(seen) and -0.4 <= info["phi"]["task"] <= -0.1
        many = numbers(seen, names)
        found.add(many)
        place = names.index("block[3].x")
        assert (many == 3) == bool(seen[place] or seen[place + 1])
        if many < 3:
            again, _, over, _, _ = env.step(env.unwrapped.moves.names.index("block[3] x +"))
            assert (again == seen).all() and not over
        assert (env.reset(seed=seed, options={"phi": {"task": (-0.4, -0.1)}})[0] == seen).all()
    assert found == {1, 2, 3}


def test_many_tables_are_as_many_single_ones(env):
    many = gymnasium.make_vec(NAME, 3, vectorization_mode="vector_entry_point", spec=SPEC)
    seen, _ = many.reset(seed=5)
    rng = np.random.default_rng(0)
    single, _ = env.reset(seed=6)
    assert (single == seen[1]).all()
    for _ in range(20):
        actions = rng.integers(env.action_space.n, size=3)
        seen, reward, over, _, _ = many.step(actions)
        single, paid, ended, _, _ = env.step(int(actions[1]))
        assert (single == seen[1]).all() and paid == reward[1] and ended == over[1]
        if over.any():
            break


def test_a_scene_of_ones_own_has_any_number_of_things(env):
    scenes = scenegen.sample(scenegen.parse(SPEC), {"task": (-0.3, None)}, n=6, seed=1)
    for scene, poses in zip(scenes, scenes.poses, strict=True):
        seen, info = env.reset(options={"scene": scene})
        assert info["phi"]["task"] == scene.phi["task"]
        assert numbers(seen, env.unwrapped.views.names) == scene.counts["block"]
        assert (env.reset(options={"scene": poses})[0] == seen).all()
    for wrong in ({"mug": (0.5, 0.5)}, {"block[1]": (0.1, 0.1), "block[3]": (0.2, 0.2), "mug": (0.5, 0.5)}):
        with pytest.raises(error.Error, match=r"a scene that (lacks|has)"):
            env.reset(options={"scene": wrong})


def test_scenes_of_a_file_start_episodes(tmp_path):
    path = scenegen.sample(scenegen.parse(SPEC), {"task": (-0.3, -0.1)}, n=9, seed=2).save(tmp_path / "a.json")
    env = gymnasium.make(NAME, spec=SPEC, source=path, goal="task")
    found = [env.reset(seed=seed)[1]["phi"]["task"] for seed in range(5)]
    assert all(-0.3 <= phi <= -0.1 for phi in found)


SCENE = {"mug": (0.3, 0.5, 0.0), "plate": (0.6, 0.5, 0.0)}


@pytest.mark.long
def test_pictures_follow_the_scene():
    env = TableTop(LEFT, render_mode="rgb_array", view="top", size=(96, 64), step=0.3)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.render()
    env.reset(options={"scene": SCENE})
    first = env.render()
    assert first.shape == (64, 96, 3) and first.dtype == np.uint8 and len(np.unique(first.reshape(-1, 3), axis=0)) > 20
    process = env.easel._live._pool
    np.testing.assert_array_equal(env.render(), first)
    env.reset(options={"scene": {**SCENE, "mug": (0.8, 0.5, 0.0)}})
    moved = env.render()
    changed = np.flatnonzero((moved != first).any(axis=2).any(axis=0))
    assert changed.min() < 48 < changed.max()  # the mug left the left half, and is in the right one
    assert env.easel._live._pool is process
    env.close()
    assert env.easel._live is None
    env.close()


def test_no_mode_no_picture():
    env = TableTop(LEFT)
    env.reset(options={"scene": SCENE})
    assert env.render() is None


@pytest.mark.long
def test_pictures_of_many_tables():
    envs = TableTopVector(2, LEFT, render_mode="rgb_array", size=(48, 32))
    envs.reset(options={"scene": SCENE})
    one, other = envs.render()
    np.testing.assert_array_equal(one, other)
    envs.step([0, 1])
    one, other = envs.render()
    assert (one != other).any()
    envs.close()
