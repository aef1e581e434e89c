"""`sample --success LO:HI --under FIT`: scenes at which a policy is predicted to succeed so often."""

import dataclasses

import numpy as np
import pytest

import scenegen
from scenegen.api.request import check_request
from scenegen.api.scenes import evaluate
from scenegen.errors import DataError, RequestError
from scenegen.errors.requests import (
    MISSING_ARGUMENT,
    NOT_FOR_MOTIONS,
    OUT_OF_PLACE,
    OUT_OF_RANGE,
    TOO_FEW_IN_CELL,
    UNREACHED_CELLS,
    WRONG_VALUE,
)
from scenegen.fit import Fit
from scenegen.sampling.plans import plan_for
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget

from .conftest import OWN, TASK

EDGE = (0.4, 0.6)


def plan(fit, spec=TASK, **asked):
    source = scenegen.parse(spec)
    asked = {"success": EDGE, **asked}
    return plan_for(source.definition, check_request(source, SampleRequest(under=fit, **asked)), Budget(60.0))


def test_all_scenes_are_in_the_range(fitted):
    path, spec = fitted("by phi"), scenegen.parse(TASK)
    scenes = scenegen.sample(spec, {"goal": (-0.6, -0.1)}, n=64, success=EDGE, under=path)
    rate = Fit.load(path).predict(scenes)
    assert len(scenes) == 64 and EDGE[0] <= rate.min() and rate.max() <= EDGE[1]
    assert evaluate(spec.checked, scenes)["goal"].tolist() == scenes.phi["goal"].tolist()
    assert [one.kind for one in scenes.warnings] == [UNREACHED_CELLS]  # most cells of phi have no such scene
    said = scenes.header.sampler["success"]
    assert said["range"] == [0.4, 0.6] and said["policy"] == "by phi" and 0.0 < said["kept"] < 0.5


def test_scenes_follow_the_base_distribution_given_the_range(fitted):
    path, spec = fitted("by phi"), scenegen.parse(TASK)
    every = scenegen.sample(spec, n=20_000, seed=4, spread="base")
    rate = Fit.load(path).predict(every)
    inside = every.phi["goal"][(rate >= 0.2) & (rate <= 0.5)]
    some = scenegen.sample(spec, n=2000, seed=5, spread="base", success=(0.2, 0.5), under=path).phi["goal"]
    assert len(inside) > 1500
    assert np.quantile(some, [0.1, 0.5, 0.9]) == pytest.approx(np.quantile(inside, [0.1, 0.5, 0.9]), abs=0.01)


def test_open_ends(fitted):
    path, spec = fitted("by phi"), scenegen.parse(TASK)
    fit = Fit.load(path)
    assert fit.predict(scenegen.sample(spec, n=8, success=(None, 0.1), under=path)).max() <= 0.1
    assert fit.predict(scenegen.sample(spec, n=8, success=Range(low=0.9), under=str(path))).min() >= 0.9


def test_specs_that_require_something_else_are_as_good(fitted):
    path = fitted("by phi")
    scenes = scenegen.sample(scenegen.parse(OWN), {"near": (-0.3, None)}, n=16, success=EDGE, under=path)
    assert len(scenes) == 16 and (scenes.phi["near"] >= -0.3).all()


@pytest.mark.long
def test_the_same_bytes_on_any_number_of_workers_in_every_place(fitted, tmp_path):
    """In memory, in a file and in a set."""
    path, spec = fitted("by phi"), scenegen.parse(TASK)
    asked = {"n": 300, "seed": 5, "success": EDGE, "under": path}
    here = scenegen.sample(spec, **asked)
    for workers in (1, 2):
        scenegen.sample_to(tmp_path / f"{workers}.jsonl", spec, workers=workers, **asked)
    assert (tmp_path / "1.jsonl").read_bytes() == (tmp_path / "2.jsonl").read_bytes()
    assert np.array_equal(scenegen.read_scenes(tmp_path / "1.jsonl").poses, here.poses)
    scenegen.sample_to(f"{tmp_path}/set/", spec, **asked)
    assert np.array_equal(scenegen.read_scenes(f"{tmp_path}/set/").poses, here.poses)


@pytest.mark.long
def test_a_run_that_was_cut_short_goes_on(fitted, tmp_path):
    spec, asked = scenegen.parse(TASK), {"n": 70_000, "success": EDGE, "under": fitted("by phi")}

    def half(found, wanted, _):
        if found > wanted / 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt, match=r"part\.parquet\.part"):
        scenegen.sample_to(tmp_path / "part.parquet", spec, workers=1, progress=half, **asked)
    some = [scenegen.sample_to(tmp_path / "part.parquet", spec, resume=True, workers=1, **asked)]
    some.append(scenegen.sample_to(tmp_path / "whole.parquet", spec, workers=1, **asked))
    assert (tmp_path / "part.parquet").read_bytes() == (tmp_path / "whole.parquet").read_bytes()
    with pytest.raises(KeyboardInterrupt):
        scenegen.sample_to(tmp_path / "other.parquet", spec, workers=1, progress=half, **asked)
    with pytest.raises(RequestError, match="`success` was"):
        scenegen.sample_to(tmp_path / "other.parquet", spec, resume=True, **{**asked, "success": (0.4, 0.7)})


@pytest.mark.long
def test_settled_scenes(fitted):
    path = fitted("by phi")
    scenes = scenegen.sample(scenegen.parse(TASK), n=4, success=EDGE, under=path, settle=True)
    rate = Fit.load(path).predict(scenes)
    assert EDGE[0] <= rate.min() and rate.max() <= EDGE[1] and scenes.header.sampler["settled"]


def test_objects_that_are_held(fitted):
    path, spec = fitted("by phi"), scenegen.parse(TASK)
    scenes = scenegen.sample(spec, n=8, success=EDGE, under=path, fix={"can": (0.6, 0.5)})
    assert (scenes.poses[:, 1, :2] == (0.6, 0.5)).all() and Fit.load(path).predict(scenes).min() >= EDGE[0]


def test_a_plan_is_another_one_for_another_range_or_fit(fitted):
    plans = [
        plan(fitted("by phi")),
        plan(fitted("by phi"), success=(0.4, 0.7)),
        plan(fitted("by nothing"), success=(0.5, 0.7)),
    ]
    assert len({one.plan_digest for one in plans}) == 3 and plans[0].plan_digest == plan(fitted("by phi")).plan_digest
    assert plans[0].plan_digest != plans[0].plan.plan_digest


def test_a_scene_out_of_the_range_is_never_returned(fitted):
    made = plan(fitted("by phi"), n=4)
    piece = made.draw(0)
    made.check(piece.rows[:, :4], piece.phi[:, :4])
    with pytest.raises(AssertionError, match="predicted success"):
        dataclasses.replace(made, low=0.0, high=0.1).check(piece.rows[:, :4], piece.phi[:, :4])


def test_too_few_scenes_are_explained(fitted):
    path = fitted("by phi")
    highest = Fit.load(path).tasks[0].model.bounds[1]
    asked = {"n": 4, "under": path, "success": (highest - 0.01, 1)}
    for timeout in (0.3, 3.0, 30.0):  # a busy machine may need all of the first just to make its plan
        with pytest.raises(RequestError) as caught:
            scenegen.sample(scenegen.parse(TASK), {"goal": (None, -0.7)}, timeout=timeout, **asked)
        (wrong,) = caught.value.diagnostics
        if wrong.kind is TOO_FEW_IN_CELL:
            break
    assert wrong.kind is TOO_FEW_IN_CELL and "0 have a predicted success of" in wrong.note


@pytest.mark.parametrize(
    "asked, kind",
    [
        ({"success": EDGE}, MISSING_ARGUMENT),
        ({"under": "by phi"}, MISSING_ARGUMENT),
        ({"success": (0.6, 0.4), "under": "by phi"}, OUT_OF_RANGE),
        ({"success": (0.4, 1.2), "under": "by phi"}, OUT_OF_RANGE),
        ({"success": 0.5, "under": "by phi"}, WRONG_VALUE),
        ({"success": ("low", 1), "under": "by phi"}, WRONG_VALUE),
        ({"success": EDGE, "under": 3}, WRONG_VALUE),
        ({"success": (0.9, 1.0), "under": "by nothing"}, OUT_OF_RANGE),
    ],
)
def test_requests_that_mean_nothing(fitted, asked, kind):
    if asked.get("under") in ("by phi", "by nothing"):
        asked = {**asked, "under": fitted(asked["under"])}
    with pytest.raises(RequestError) as caught:
        scenegen.sample(scenegen.parse(TASK), n=2, **asked)
    assert caught.value.diagnostics[0].kind is kind


def test_where_it_has_no_place(fitted):
    path, spec = fitted("by phi"), scenegen.parse(TASK)
    asked = {"success": EDGE, "under": path}
    with pytest.raises(RequestError) as caught:
        scenegen.sample(spec, fix={"can": np.array([[0.5, 0.5], [0.6, 0.5]])}, **asked)
    assert caught.value.diagnostics[0].kind is OUT_OF_PLACE
    with pytest.raises(RequestError, match="draws how many"):
        scenegen.sample(scenegen.parse("object block[1..2], mug\ntask: forall b in block: leftOf(b, mug)"), **asked)
    moving = scenegen.parse("time 4 steps\nobject mug\ntask: always(x(mug) >= 0.2)")
    with pytest.raises(RequestError) as caught:
        check_request(moving, SampleRequest(success=EDGE, under=path))
    assert caught.value.diagnostics[0].kind is NOT_FOR_MOTIONS
    with pytest.raises(DataError):
        scenegen.sample(spec, n=2, success=EDGE, under=path.with_name("none.fit"))


def test_typed(fitted):
    request = SampleRequest.parse({"success": "0.4:", "under": "p.fit"}, ["goal"])
    assert request.success == Range(0.4, None) and str(request.under) == "p.fit"
    for text in ("0.5", "0.6:0.4", "low:", "0.4:1.5"):
        with pytest.raises(RequestError):
            SampleRequest.parse({"success": text}, ["goal"])
