"""What a model's user is told: by the figures of its file, and of raw scenes what they break. Values as people have
them: of numpy, torch and pandas; poses of held objects; ranges reached only at a bound. What people give from
Python that is of the wrong kind gets the project's own words, and before any work is done.
"""

import inspect
import json
import typing
from pathlib import Path
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
import torch

import scenegen
from scenegen.api.monitor import read_trajectories
from scenegen.errors import DataError, RequestError
from scenegen.learn.faults import faults, relevant_quality
from scenegen.learn.model import advice
from scenegen.learn.models.card import LabelData, QualityData, RangeData
from scenegen.robosuite import Placement
from scenegen.sampling.request import Range


def at(coverage=0.95, error=0.001, **wanted):
    rest = {"truth": 0.97, "ks": 0.05, "sliced": 0.06, "energy": 0.0, "required": 1.0}
    return QualityData(wanted=wanted, coverage=coverage, error=error, **rest)


def test_good_figures_say_nothing():
    assert faults([at(task=0.0), at(0.85, 0.02, task=0.1)]) == []


def test_what_is_left_out_and_what_misses():
    left_out, far = (fault.title for fault in faults([at(0.5, task=0.0), at(0.4, 0.05, task=0.1), at(task=0.2)]))
    assert "0.40 at task 0.1; 0.50 at task 0 (exact" in left_out and "0.050 at task 0.1 on average" in far
    assert "; 2 more" in faults([at(0.1 * number, task=0.1 * number) for number in range(5)])[0].title


def test_a_request_is_judged_by_the_figures_of_its_labels():
    figures = [at(0.5, task=-0.5), at(task=0.0), at(0.6, task=0.1), at(0.1, safe=0.0), at(0.2, task=0.0, safe=0.0)]
    assert relevant_quality(figures, {"task": Range(-0.01, 0.05)}) == [figures[1]]
    assert relevant_quality(figures, {"task": Range(0.2, 0.3)}) == [figures[2]]  # the nearest
    assert relevant_quality(figures, {"task": Range(-1.0, None)}) == figures[:3]
    assert relevant_quality(figures, {"task": Range(-0.1, 0.1), "safe": Range(-0.1, 0.1)}) == [figures[4]]
    assert relevant_quality(figures, {}) == figures


TEXT = """object a = cylinder(0.1, 0.1), b = cylinder(0.1, 0.1)
require noOverlap()
task: leftOf(a, b)
"""


def table(*phi):
    return np.array([[-np.inf, np.inf, *phi]])


EVEN = (table(*np.linspace(-1.0, 0.2, 121)),)


def stub(spec=None, ranges=None, regions=EVEN):
    labels = [LabelData(name="task", lowest=-1.0, highest=0.2)]
    card = SimpleNamespace(quality=[at(0.5, task=0.0)], ranges=ranges, labels=labels, scenegen="0.1")
    trained = SimpleNamespace(label_ranges={"task": (-1.0, 0.2)}, card=card, regions=regions)
    made = SimpleNamespace(trained=trained, spec=spec or scenegen.parse(TEXT))
    made.members = (({}, made),)
    return made


@pytest.mark.parametrize(("raw", "said"), [(False, 1), (True, 3)])
def test_raw_scenes_are_told_of_more(raw, said):
    rows = np.array([[0.1, 0.5], [0.5, 0.5], [0.0, 0.0], [0.9, 0.55], [0.5, 0.5], [0.0, 0.0]])
    found = advice(stub(), {"task": Range(-0.1, 0.3)}, rows, raw)
    assert len(found) == said and all(one.severity == "warning" for one in found)
    assert "cover 0.50 at task 0" in found[0].title
    if raw:
        assert "from -1 to 0.2; beyond it guesses" in found[1].title
        assert found[2].title == "1 of 2 raw scenes do not meet what the spec requires"


def test_models_of_drawn_numbers_are_told_of_by_their_numbers():
    spec = scenegen.parse(
        "object a[1..2] = cylinder(0.1, 0.1), b = cylinder(0.1, 0.1) require noOverlap() task: leftOf(a[1], b)"
    )
    family = SimpleNamespace(spec=spec, members=tuple((numbers, stub(member)) for numbers, member in spec.members))
    x, y = np.array([[0.1, 0.1, 0.1], [np.nan, 0.9, 0.15], [0.5, 0.5, 0.5]]), 0.5  # the last one: a[2] stands on a[1]
    rows = np.array([row for one in x for row in (one, y + 0 * one, 0 * one)])
    found = [one.title for one in advice(family, {"task": Range(0.0, 0.1)}, rows, True)]
    assert len(found) == 3, found
    assert [one.partition(":")[0] for one in found] == ["with a[1]", "with a[2]", "with a[2]"]
    assert found[2].endswith("1 of 2 raw scenes do not meet what the spec requires")


def in_range(coverage=0.96, phi=0.03, **wanted):
    return RangeData(wanted=wanted, phi=phi, coverage=coverage, truth=0.97, ks=0.05, sliced=0.06, energy=0.0)


def codes(made, **ends):
    return [one.code for one in advice(made, {label: Range(*both) for label, both in ends.items()}, None, False)]


def test_a_range_that_was_not_measured_is_told():
    """Where a card was made, and neither a value in the range nor a good part of a measured range is asked for."""
    near = {"task": (0.0, None)}
    made = stub(ranges=[in_range(**near)])
    made.trained.card.quality = [at(task=-0.5)]
    assert codes(made, task=(0.0, None)) == [] and codes(made, task=(-0.6, -0.4)) == []
    assert codes(made, task=(0.05, 0.2)) == []
    assert codes(made, task=(-0.4, -0.1)) == ["not-measured"] == codes(made, task=(0.19, 0.2))
    [said] = advice(made, {"task": Range(-0.4, -0.1)}, None, False)
    assert said.title == "how good the model is at task=-0.4:-0.1 was not measured" and "'task': " not in said.title
    crowded = stub(ranges=[in_range(**near)], regions=(table(*np.linspace(0.0, 0.02, 95), 0.03, 0.1, 0.15, 0.2),))
    crowded.trained.card.quality = []
    assert codes(crowded, task=(0.005, 0.2)) == [] and codes(crowded, task=(0.02, 0.2)) == ["not-measured"]
    unmeasured = stub(ranges=[])
    unmeasured.trained.card.quality = []
    assert codes(unmeasured, task=(0.0, None)) == ["not-measured"]
    unmeasured.trained.card.ranges = None  # no card was made
    assert codes(unmeasured, task=(0.0, None)) == []


@pytest.mark.parametrize("poor", [{"coverage": 0.7}, {"phi": 0.5}])
def test_a_range_where_the_model_is_unlike_exact_scenes_is_told(poor):
    made = stub(ranges=[in_range(**poor, task=(0.0, None))])
    made.trained.card.quality = [at(task=0.0), at(task=-0.5)]
    assert codes(made, task=(0.0, None)) == ["poor-model"] == codes(made, task=(-0.1, 0.1))
    assert codes(made, task=(-0.6, -0.4)) == []


def test_a_file_without_a_table_of_phi_says_what_it_lacks():
    made = stub(regions=())
    made.trained.card.quality = []
    assert codes(made, task=(0.0, None)) == ["no-table-of-phi"] and codes(made, task=(0.0, 0.1)) == []


HELD = scenegen.parse("object mug, plate at (0.5, 0.5, 30 deg)\ntask: closeTo(mug, plate, 15 cm)")
OVER_TIME = scenegen.parse("object mug, plate at (0.5, 0.5)\ntime 1 steps\ntask: always closeTo(mug, plate, 15 cm)")
AT_BOUND = scenegen.parse("object red, blue\ntask: closeTo(red, blue, 20 cm) & angle(red, NORTH, 0 deg)")
PAIR = scenegen.parse("object mug, plate\ntask: closeTo(mug, plate, 15 cm)")
TABLE = "scenegen.curriculum:scenegen/TableTop-v0"


def poses_of(*shape, theta=0.0):
    poses = torch.full((*shape, 2, 3), 0.5, dtype=torch.float64)
    poses[..., 2] = theta
    return poses


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
@pytest.mark.parametrize("turns", [-1, 0, 3])
def test_held_objects_in_their_place_are_taken(dtype, turns):
    poses = poses_of(4, theta=np.pi / 6 + turns * 2 * np.pi).to(dtype)
    assert torch.allclose(HELD.robustness()(poses), torch.full((4, 1), 0.15, dtype=dtype))


@pytest.mark.parametrize(("axis", "by"), [(0, 0.4), (1, 1e-6), (2, 0.1)])
def test_a_held_object_elsewhere_is_refused_by_robustness(axis, by):
    poses = poses_of(4, theta=np.pi / 6)
    poses[2, 1, axis] += by
    with pytest.raises(ValueError, match=r"`plate` is held at \(0.5, 0.5, 0.523599\).* in scene 2; take the `at`"):
        HELD.robustness()(poses)


def test_a_held_object_elsewhere_is_refused_over_time():
    poses = poses_of(3, 2)
    assert OVER_TIME.trace_robustness()(poses).flatten().tolist() == [0.15] * 3
    poses[1, 1, 1, 0] = 0.9
    with pytest.raises(ValueError, match="elsewhere at moment 1 of motion 1"):
        OVER_TIME.trace_robustness()(poses)


def test_a_held_object_elsewhere_is_refused_by_monitors():
    monitor = scenegen.Monitor(OVER_TIME)
    assert monitor.add({"mug": (0.5, 0.5, 0.0)}).high["task"] == 0.15
    for moved in ({"mug": (0.5, 0.5, 0), "plate": (0.9, 0.5, 0)}, [[0.5, 0.5, 0], [0.9, 0.5, 0]]):
        with pytest.raises(RequestError, match=r"held-elsewhere.*at moment 1"):
            monitor.add(moved)


def test_a_held_object_elsewhere_is_refused_in_recordings(tmp_path):
    rows = "0,.5,.5,0,.5,.5,0\n1,.5,.5,0,{x},.5,0\n"
    text = "t,mug.x,mug.y,mug.theta,plate.x,plate.y,plate.theta\n" + rows
    path = tmp_path / "recorded.csv"
    path.write_text(text.format(x=0.5))
    assert read_trajectories(OVER_TIME, path)[0][None].shape == (2, 2, 3)
    path.write_text(text.format(x=0.9))
    with pytest.raises(DataError, match=r"held-elsewhere.*at moment 1"):
        read_trajectories(OVER_TIME, path)


@pytest.mark.parametrize(
    "ask",
    [
        lambda: scenegen.pairs(AT_BOUND, n=2),
        lambda: Placement(AT_BOUND, (0, None))._starts.take(),
        lambda: scenegen.pairs(PAIR, start=(0.15, None), n=2),
    ],
)
def test_a_promised_range_that_phi_reaches_only_at_its_bound_is_refused(ask):
    with pytest.raises(RequestError, match=r"only-at-bound.*\n.*ask for a band beside it"):
        ask()


@pytest.mark.parametrize("ends", [(0, None), (0.0, 0.1)])
def test_environments_refuse_it_with_the_range_to_ask_for(ends):
    env = gymnasium.make(TABLE, spec=AT_BOUND)
    with pytest.raises(gymnasium.error.InvalidBound, match=r"ask for a band beside it, -0.025:0"):
        env.reset(seed=0, options={"phi": ends})


def test_sample_warns_and_draws_the_band():
    scenes = scenegen.sample(AT_BOUND, (0, None), n=4)
    assert [(one.code, one.severity) for one in scenes.warnings] == [("only-at-bound", "warning")]
    assert (scenes.phi["task"] >= -0.025).all()


@pytest.mark.parametrize(
    "ends", [np.array([0, 0.1]), torch.tensor([0, 0.1]), (torch.tensor(0.0), np.float32(0.1)), [np.int64(0), 0.1]]
)
def test_ranges_of_numpy_and_torch(ends):
    for phi in (ends, {"task": ends}):
        found = scenegen.sample(PAIR, phi, n=4).phi["task"]
        assert ((found >= 0) & (found <= 0.1001)).all()
    env = gymnasium.make(TABLE, spec=PAIR, phi=ends)
    assert 0 <= env.reset(seed=0)[1]["phi"]["task"] <= 0.1001


@pytest.mark.parametrize("ends", [np.zeros(3), "ab", 0.5, np.array([["a", "b"]]), (None, "x"), torch.zeros(2, 2)])
def test_what_is_no_range_is_refused(ends):
    with pytest.raises(RequestError, match="range-not-a-pair"):
        scenegen.sample(PAIR, ends, n=1)


def test_poses_of_numpy_and_torch_are_held():
    scenes = scenegen.sample(PAIR, n=4)
    for pose in (scenes.poses[3, 1], torch.tensor([0.25, 0.75]), (np.float32(0.25), torch.tensor(0.75))):
        held = scenegen.sample(PAIR, n=2, fix={"plate": pose}).poses[:, 1, : len(pose)]
        assert (held == np.array([float(one) for one in pose])).all()
    with pytest.raises(RequestError, match="not-a-pose"):
        scenegen.sample(PAIR, n=2, fix={"plate": np.zeros(4)})


def test_scenes_are_picked_by_masks_of_pandas_and_torch():
    scenes = scenegen.sample(PAIR, n=8)
    frame = scenes.to_pandas()
    mask = scenes.phi["task"] > np.median(scenes.phi["task"])
    for picked in (frame["phi.task"] > frame["phi.task"].median(), torch.from_numpy(mask), mask.tolist()):
        assert (scenes[picked].poses == scenes.poses[mask]).all()
    assert (scenes[torch.tensor(2)].poses["mug"].x, scenes[np.int64(-1)].poses["mug"].x) == tuple(
        scenes.poses[[2, -1], 0, 0]
    )
    assert len(scenes[torch.tensor([1, 2])]) == 2 and len(scenes[np.array([])]) == 0
    for bad in (
        torch.zeros(8),
        torch.ones(7, dtype=torch.bool),
        frame["phi.task"],
        torch.zeros(2, 2, dtype=torch.long),
    ):
        with pytest.raises(RequestError, match="not-an-index"):
            scenes[bad]


SURFACES = scenegen.parse("""
workspace [0, 0.9] x [0, 0.6]
object coaster = cylinder(5.5 cm, 0.5 cm), mug on any of [coaster, workspace]
require noCollision()
task: on(mug, coaster)
other: leftOf(mug, coaster)
""")


@pytest.mark.parametrize("goal", ["task", None])
def test_a_goal_on_a_surface_that_no_move_reaches_is_refused_when_the_environment_is_made(goal):
    with pytest.raises(gymnasium.error.Error, match=r"always on `coaster.top`; let `mug` .*choices-not-here"):
        gymnasium.make(TABLE, spec=SURFACES, move="mug", goal=goal)
    gymnasium.make(TABLE, spec=SURFACES, move="mug", goal="other")


def test_observations_and_moves_leave_out_headings_that_make_no_difference():
    spec = "object cup = cylinder(4 cm, 9 cm), tin = cylinder(4 cm, 9 cm), book = box(9 cm, 5 cm, 2 cm)\n"
    spec += "require noOverlap()\ntask: gap(book, cup) <= 5 cm & closeTo(cup, tin)"
    env = gymnasium.make(TABLE, spec=spec).unwrapped
    assert [name for name in env.views.names if name.endswith((".cos", ".sin"))] == ["book.cos", "book.sin"]
    assert [name for name in env.moves.names if "theta" in name] == ["book theta +", "book theta -"]
    env = gymnasium.make(TABLE, spec=spec + " & angle(cup, NORTH)").unwrapped
    assert "cup.cos" in env.views.names and "cup theta +" in env.moves.names


def test_the_repr_of_a_rarity_fits_a_terminal():
    assert len(repr(scenegen.rarity(PAIR))) < 500


WITH_TORCH = {"train"}  # names types of training


@pytest.mark.parametrize("name", [name for name in scenegen.__all__ if inspect.isfunction(getattr(scenegen, name))])
def test_type_hints_resolve(name):
    if name not in WITH_TORCH:
        assert "return" in typing.get_type_hints(getattr(scenegen, name))


def test_a_mask_with_holes_says_where():
    import pandas
    import polars

    scenes = scenegen.sample(scenegen.parse("task: leftOf(mug, plate)"), n=3)
    mask = [True, None, False]
    for given in (
        mask,
        pandas.array(mask, dtype="boolean"),
        pandas.Series(mask, dtype="boolean"),
        polars.Series(mask),
        np.array(mask, dtype=object),
    ):
        with pytest.raises(RequestError, match=r"a mask without a value at 1 does not pick scenes\n.*fillna\(False\)"):
            scenes[given]
    assert len(scenes[pandas.array([True, False, True], dtype="boolean")]) == 2


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse("leftOf(mug, plate)")


@pytest.fixture(scope="module")
def scenes(spec):
    return scenegen.sample(spec, n=3)


@pytest.fixture(scope="module")
def model(spec, tmp_path_factory):
    out = tmp_path_factory.mktemp("model") / "m.safetensors"
    return scenegen.train(spec, "gan", data="uniform", out=out, epochs=np.int64(1), scenes=200, lr=np.float32(1e-3))


def test_numpys_numbers_are_as_good_as_pythons(spec, tmp_path):
    found = scenegen.sample(spec, n=np.int64(3), seed=np.int32(5), timeout=np.float32(60.0))
    again = scenegen.read_scenes(found.save(tmp_path / "s.json"))
    assert (again.poses == scenegen.sample(spec, n=3, seed=5).poses).all()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"n": True}, "`n` is True"),
        ({"workers": "2"}, "`workers` is '2'"),
        ({"workers": 1.5}, "`workers` is 1.5"),
        ({"method": None}, "unknown method `None`"),
        ({"spread": 3}, "unknown spread `3`"),
        ({"phi": {0: (0.0, 0.1)}}, "no label `0`"),
        ({"fix": {0: (0.5, 0.5)}}, "no object `0`"),
        ({"fix": np.zeros(3)}, "poses by name"),
    ],
)
def test_requests(spec, options, said):
    with pytest.raises(scenegen.RequestError, match=said):
        scenegen.sample(spec, **options)


@pytest.mark.parametrize("call", [scenegen.rarity, lambda spec: scenegen.train(spec, "gan", out="never.safetensors")])
def test_a_path_is_no_spec(call):
    with pytest.raises(scenegen.RequestError, match=r"a Spec is needed here, not 'a.spec'(.|\n)*load it first"):
        call("a.spec")


@pytest.mark.long
def test_specs_and_models(model, tmp_path):
    with pytest.raises(scenegen.RequestError, match=r"scenegen.load\(FILE\) reads a file"):
        scenegen.parse(Path("a.spec"))
    with pytest.raises(scenegen.RequestError, match="`path` is None"):
        scenegen.load(None)
    with pytest.raises(scenegen.RequestError, match="a Spec is needed here"):
        scenegen.load_model(tmp_path / "m.safetensors", "a.spec")
    with pytest.raises(scenegen.RequestError, match="a Spec is needed here, not <Model gan"):
        scenegen.rarity(model)
    with pytest.raises(scenegen.RequestError, match="`seed` is '0'"):
        scenegen.rarity(model.spec, seed="0")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"epoch": 3}, "unknown option `epoch`(.|\n)*did you mean `epochs`"),
        ({"hyper": 5}, "`hyper` is 5"),
        ({"hyper": {"widht": 5}}, "no setting `widht`(.|\n)*did you mean `width`"),
        ({"data": ["a"]}, r"`data` is \['a'\]"),
        ({"epochs": True}, "`epochs` is True"),
    ],
)
def test_trainings(spec, tmp_path, options, said):
    with pytest.raises(scenegen.RequestError, match=said):
        scenegen.train(spec, "gan", out=tmp_path / "m.safetensors", **options)
    assert not list(tmp_path.iterdir())


def test_data_by_path_and_never_overwritten(spec, tmp_path):
    data = scenegen.sample(spec, n=64).save(tmp_path / "d.json")
    before = data.read_bytes()
    settings = {"epochs": 1, "data": data}
    with pytest.raises(scenegen.OutputError, match="would overwrite what it is made from"):
        scenegen.train(spec, "gan", out=data, **settings)
    made = scenegen.train(spec, "gan", out=tmp_path / "m.safetensors", **settings)
    assert data.read_bytes() == before and made.trained.card.training["data"] == str(data)


def test_sample_to_looks_at_the_file_first(spec, model, tmp_path):
    with pytest.raises(scenegen.RequestError, match="`n` is '10'"):
        scenegen.sample_to(tmp_path / "s.json", spec, n="10")
    (tmp_path / "folder.json").mkdir()
    for out in (tmp_path / "none" / "s.json", tmp_path / "folder.json"):
        for source in (spec, model):
            with pytest.raises(scenegen.OutputError, match="cannot write"):
                scenegen.sample_to(out, source, n=3)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.json"]


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"size": "64x48"}, "`size` is '64x48'"),
        ({"size": (64, 48, 3)}, "width and height in pixels"),
        ({"size": (64.5, 48)}, "`width` is 64.5"),
        ({"views": "top"}, r"`views` is 'top'(.|\n)*\(\"top\",\)"),
        ({"workers": "2"}, "`workers` is '2'"),
        ({"renderer": None}, "unknown renderer `None`"),
    ],
)
def test_pictures(scenes, tmp_path, options, said):
    with pytest.raises(scenegen.RequestError, match=said):
        scenes.render(tmp_path / "p", **options)


def test_figures(scenes, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(scenegen.RequestError, match=r"after the folder(.|\n)*`sheet`"):
        scenes.figures("sheet")
    with pytest.raises(scenegen.RequestError, match="no label `0`"):
        scenes.figures("d", "topview", label=0)
    assert not list(tmp_path.iterdir())


def test_one_scene_for_a_simulator(scenes):
    with pytest.raises(scenegen.RequestError, match=r"scenes\[0\]"):
        scenegen.load_pybullet(scenes)


def test_poses_that_nobody_scored_are_saved_and_exported(scenes, tmp_path):
    text = json.loads(scenes.save(tmp_path / "s.json").read_bytes())
    for one in text["scenes"]:
        one["phi"] = {}
    (tmp_path / "plain.json").write_text(json.dumps(text))
    plain = scenegen.read_scenes(tmp_path / "plain.json")
    assert (scenegen.read_scenes(plain.save(tmp_path / "again.json")).poses == scenes.poses).all()
    assert len(plain.export(tmp_path / "worlds", to="mjcf")) == 3
