"""Scenes of a spec that draws how many things there are: each number has its share, and its own spec's scenes."""

import numpy as np
import pytest
from scipy import stats

import scenegen
from scenegen.api.request import plan_of
from scenegen.api.scenes import evaluate
from scenegen.errors import RequestError
from scenegen.sampling.families import seed_of
from scenegen.sampling.plan import Tally
from scenegen.sampling.problem import Budget
from scenegen.sampling.rarity import MixedTail, constant, mean
from scenegen.sampling.request import SampleRequest

SPEC = "object block[2..4], cup[1..2], mug\nrequire x(mug) >= 0.3\ntask: forall b in block: leftOf(b, mug)\n"
RARE = "object block[2..4], mug\ntask: forall b in block: leftOf(b, mug) & x(mug) >= block.count * 0.3\n"


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse(SPEC)


@pytest.fixture(scope="module")
def drawn(spec):
    return scenegen.sample(spec, (0.0, 0.2), n=120, seed=1)


def test_the_numbers_are_uniform(drawn):
    combinations = drawn.counts["block"] * 10 + drawn.counts["cup"]
    _, each = np.unique(combinations, return_counts=True)
    assert each.tolist() == [20] * 6
    # in any order: the first half has about half of each
    _, first = np.unique(combinations[:60], return_counts=True)
    assert stats.chisquare(first).pvalue > 1e-3 and len(set(combinations[:12].tolist())) > 3


def test_given_the_numbers_the_scenes_are_those_of_the_ordinary_spec(spec):
    drawn = scenegen.sample(spec, (0.0, None), n=30, seed=1)
    for numbers, which in drawn.parts():
        member = spec.with_counts(numbers)
        mine = scenegen.sample(member, (0.0, None), n=5, seed=seed_of(1, numbers))
        some = drawn.only(numbers, which)
        assert some.objects == member.objects
        assert sorted(some.poses.tolist()) == sorted(mine.poses.tolist()), "the very same, in another order"


def test_absent_objects_have_no_pose_and_phi_is_that_of_the_rest(spec, drawn):
    assert (np.isnan(drawn.poses).all(axis=2) == ~drawn.present).all()
    assert (drawn.present.sum(axis=1) == drawn.counts["block"] + drawn.counts["cup"] + 1).all()
    assert (evaluate(spec.drawn, drawn)["task"] == drawn.phi["task"]).all()
    assert ((drawn.phi["task"] >= 0.0) & (drawn.phi["task"] <= 0.2)).all()
    scene = drawn[0]
    assert set(scene.poses) == {name for name, here in zip(drawn.objects, drawn.present[0], strict=True) if here}
    assert scene.counts == {name: numbers[0] for name, numbers in drawn.counts.items()}


@pytest.mark.long
def test_the_bytes_do_not_depend_on_workers_nor_on_how_they_are_written(spec, drawn, tmp_path):
    drawn.save(tmp_path / "memory.parquet")
    for name, workers in (("one", 1), ("two", 2)):
        scenegen.sample_to(tmp_path / f"{name}.parquet", spec, (0.0, 0.2), n=120, seed=1, workers=workers)
        assert (tmp_path / f"{name}.parquet").read_bytes() == (tmp_path / "memory.parquet").read_bytes()


def test_a_number_without_scenes_is_left_out_and_told():
    spec = scenegen.parse(RARE)
    found = scenegen.sample(spec, (0.0, None), n=9, seed=2)
    assert (
        sorted(found.counts["block"].tolist()) == [2] * 5 + [3] * 4
        or sorted(found.counts["block"].tolist()) == [2] * 4 + [3] * 5
    )
    (warning,) = found.warnings
    assert warning.code == "number-left-out" and "block[4]" in warning.title
    assert [one["numbers"] for one in found.header.sampler["left_out"]] == [{"block": 4}]
    assert [one["share"] for one in found.header.sampler["numbers"]] == [0.5, 0.5]
    with pytest.raises(RequestError) as error:
        scenegen.sample(spec, (0.95, None), n=9)
    assert error.value.diagnostics[0].code == "no-number-possible"


def test_groups_of_cells_have_equal_shares_whatever_they_reach():
    spec = scenegen.parse("object block[1..2], mug\ntask: x(mug) <= 0.4 * block.count\n")
    found = scenegen.sample(spec, (0.0, 0.8), n=64, seed=3)
    assert np.bincount(found.counts["block"]).tolist() == [0, 32, 32]
    assert found.phi["task"][found.counts["block"] == 1].max() <= 0.4


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"fix": {"block[4]": (0.5, 0.5)}}, "held-may-be-missing"),
        ({"fix": {"blok": (0.5, 0.5)}}, "unknown-object"),
        ({"n": 0}, "out-of-range"),
        ({"method": "model"}, "without-model"),
        ({"phi": {"other": (0.0, 1.0)}}, "unknown-label"),
    ],
)
def test_a_request_that_is_wrong_is_refused(spec, options, code):
    with pytest.raises(RequestError) as error:
        scenegen.sample(spec, **{"phi": (0.0, None), "n": 2, **options})
    assert error.value.diagnostics[0].code == code


@pytest.mark.long
def test_surfaces_are_chosen_of_those_that_are_there(tmp_path):
    text = "object tray, can[1..3] on any of [tray.inside, workspace], mug on tray\n"
    found = scenegen.sample(scenegen.parse(text + "task: leftOf(mug, can[1])"), (0.0, None), n=9, seed=4)
    assert (np.isnan(found.on) == ~found.present[:, 1:4]).all()
    for ending in ("json", "jsonl", "parquet"):
        path = found.save(tmp_path / f"a.{ending}")
        again = scenegen.read_scenes(path)
        assert np.array_equal(again.on, found.on, equal_nan=True)
        assert np.array_equal(again.poses, found.poses, equal_nan=True)
    assert (
        evaluate(scenegen.parse(text + "task: leftOf(mug, can[1])").drawn, again)["task"] == found.phi["task"]
    ).all()


def test_the_mixture_of_tails_is_the_mean():
    low, high = constant(0.1), constant(0.3)
    tail = MixedTail((low.up, high.up))
    assert (tail.end, tail.whole) == (0.3, True)
    assert 10.0 ** tail(0.2).log10 == pytest.approx(0.5) and tail(0.05).log10 == 0.0 and tail(0.4) is None
    assert tail.quantile(0.25) == 0.3 and tail.quantile(0.75) == 0.1
    assert mean([None, None]) is None


def test_a_run_that_is_cut_short_does_not_speak_of_equal_shares(spec):
    plan = plan_of(spec, SampleRequest(n=10), Budget(30.0))
    assert all(one["share"] == 1 / 6 for one in plan.account(Tally(10, 10, 6, 60)).info["numbers"])
    assert not any("share" in one for one in plan.account(Tally(0, 7, 4, 7)).info["numbers"])
