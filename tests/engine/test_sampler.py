"""A real sampler's pieces, scored by torch, streamed and re-scored by another evaluator."""

import dataclasses

import numpy as np
import pytest

from scenegen.api.reading import read_scenes
from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import evaluate
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import gated
from scenegen.sampling.engine.stream import stream_scenes
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.scenes.data import RequestData


@pytest.fixture
def spec():
    """A requirement beside the label: the last row of phi, which no file holds. Here it is the second label."""
    whole = check_text("object mug, plate\ntask: leftOf(mug, plate)\nsafe: farFrom(mug, plate)\n", "two.spec")
    labels = dict(whole.core.labels)
    core = dataclasses.replace(whole.core, labels={"task": labels["task"]}, requirement=labels["safe"])
    return dataclasses.replace(whole, core=core)


def streamed(path, spec, workers):
    from rejected import Rejected

    problem = make_problem(spec, SampleRequest({"task": Range(0.0, 0.3)}, n=20_000, seed=9))
    request = RequestData(phi={"task": (0.0, 0.3)}, n=20_000)

    def header(tally):
        draws = tally.pieces * problem.piece_size
        return make_header(spec, {"method": "rejection", "seed": 9, "draws": draws}, request)

    return stream_scenes(
        path, Rejected(problem), spec.labels, header, request={"spec": spec.sha256}, workers=workers, size=6000
    )


def test_scenes_are_those_asked_for(tmp_path, spec):
    tally = streamed(tmp_path / "x.parquet", spec, 1)
    scenes = read_scenes(tmp_path / "x.parquet")
    assert len(scenes) == tally.scenes == 20_000 and list(scenes.phi) == ["task"]
    assert scenes.header.sampler["draws"] == 65_536 * tally.pieces
    np.testing.assert_array_equal(evaluate(spec, scenes)["task"], scenes.phi["task"])
    poses = scenes.poses
    assert np.hypot(*(poses[:, 0, :2] - poses[:, 1, :2]).T).min() >= 0.25 - 1e-12
    assert gated(spec.core) is not spec.core
    counts = np.histogram(scenes.phi["task"], bins=32, range=(0.0, 0.3))[0]
    assert counts.min() == counts.max() == 625


@pytest.mark.slow
def test_workers_hand_out_the_same_bytes(tmp_path, spec):
    for workers in (1, 2, 5):
        streamed(tmp_path / f"{workers}.parquet", spec, workers)
    one, two, five = (path.read_bytes() for path in sorted(tmp_path.iterdir()))
    assert one == two == five
