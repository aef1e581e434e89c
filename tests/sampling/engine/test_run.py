"""One path from plans to scenes: the same scenes on any number of processes, in memory and in every format."""

import json
import subprocess
import sys

import numpy as np
import pytest

import scenegen
from scenegen.api.reading import read_scenes
from scenegen.errors import RequestError
from scenegen.lang.checker import check_text
from scenegen.resources import shipped_specs
from scenegen.sampling.engine import run
from scenegen.sampling.engine.run import jobs
from scenegen.sampling.plans import draw, make_plan
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget

TEXT = "object mug, plate, cup\nrequire farFrom(mug, plate, 0.1)\ntask: leftOf(mug, plate) & closeTo(cup, mug, 0.3)\n"
# name -> method, wanted ends, scenes
CASES = {
    "flat": ("rejection", (-0.2, 0.2), 10_000),
    "base": ("rejection", (0.0, None), 5000),
    "splitting": ("splitting", (0.1, 0.2), 500),
}


@pytest.fixture(scope="module", autouse=True)
def few_chains():
    """An eighth of splitting's usual chains."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scenegen.sampling.splitting.sampler.MAX_CHAINS", 1024)
        yield


@pytest.fixture(
    scope="module", params=[pytest.param(one, marks=[pytest.mark.long] * (one == "splitting")) for one in CASES]
)
def case(request):
    """A call, and its scenes drawn in this process."""
    method, ends, n = CASES[request.param]
    words = {"phi": {"task": ends}, "n": n, "seed": 6, "method": method}
    return words, scenegen.sample(scenegen.parse(TEXT), **words, workers=1)


@pytest.mark.parametrize("workers", [2, pytest.param(5, marks=pytest.mark.slow)])
def test_workers_change_nothing(case, workers):
    words, alone = case
    shared = scenegen.sample(scenegen.parse(TEXT), **words, workers=workers)
    assert shared.poses.tobytes() == alone.poses.tobytes()
    assert shared.phi["task"].tobytes() == alone.phi["task"].tobytes()
    assert shared.header == alone.header


@pytest.mark.long
def test_formats_and_memory_hold_the_same(case, tmp_path):
    words, alone = case
    # a plan for splitting takes a second
    for ending in (".parquet",) if words["method"] == "splitting" else (".json", ".jsonl", ".parquet"):
        streamed, saved = tmp_path / f"streamed{ending}", tmp_path / f"saved{ending}"
        written = scenegen.sample_to(streamed, scenegen.parse(TEXT), **words, workers=1)
        alone.save(saved)
        assert streamed.read_bytes() == saved.read_bytes(), ending
        assert written.count == len(written) == len(alone) and written.header == alone.header
        met = written.phi["task"]
        assert met.lowest == alone.phi["task"].min() and met.highest == alone.phi["task"].max()
        assert met.mean == pytest.approx(alone.phi["task"].mean(), rel=1e-12)
        if ending != ".json":  # read as a whole, which takes its time
            read = read_scenes(streamed)
            assert np.array_equal(read.poses, alone.poses) and read.header == alone.header


def test_scenes_are_those_asked_for(case):
    """By numpy's own words, not the spec's."""
    words, alone = case
    mug, plate, cup = (alone.poses[:, thing] for thing in range(3))
    assert np.hypot(*(mug - plate).T[:2]).min() >= 0.1
    left, near = plate[:, 0] - mug[:, 0], 0.3 - np.hypot(*(cup - mug).T[:2])
    np.testing.assert_allclose(np.minimum(left, near), alone.phi["task"], atol=1e-12)
    low, high = words["phi"]["task"]
    assert alone.phi["task"].min() >= low and alone.phi["task"].max() <= (np.inf if high is None else high)
    if high is not None:
        counts = np.histogram(alone.phi["task"], np.linspace(low, high, 33))[0]
        assert counts.max() - counts.min() <= 1


def test_a_scene_that_should_not_come_out_is_not_handed_out(monkeypatch, tmp_path):
    spec = scenegen.parse(TEXT)
    plan = make_plan(
        make_problem(spec.checked, SampleRequest({"task": Range(0.0)}, n=100)), Budget(), method="rejection"
    )
    honest = type(plan).draw

    def lies(self, k):
        made = honest(self, k)
        made.phi[0, 0] += 1e-6
        return made

    monkeypatch.setattr(type(plan), "draw", lies)
    with pytest.raises(AssertionError, match="disagree"):
        scenegen.sample(spec, {"task": (0.0, None)}, 100)
    with pytest.raises(AssertionError, match="disagree"):
        scenegen.sample_to(tmp_path / "x.jsonl", spec, {"task": (0.0, None)}, 100)
    assert not (tmp_path / "x.jsonl").exists()


@pytest.mark.long
def test_small_requests_stay_in_this_process(exp1, monkeypatch):
    monkeypatch.setattr(run, "cores", lambda: 8)

    def processes(n, workers=None):
        request = SampleRequest({"task": Range(0.0, 0.2)}, n, workers=workers)
        return jobs(make_plan(make_problem(exp1, request), Budget()))

    assert processes(10_000) == 1 < processes(30_000_000) <= processes(1_000_000_000) == 8
    assert processes(1_000_000_000, 3) == 3 and processes(10_000, 3) == 3


@pytest.mark.long
def test_when_time_is_up_the_folder_says_how_to_go_on(tmp_path):
    spec, path = scenegen.parse(TEXT), tmp_path / "x.parquet"
    words = {"phi": {"task": (0.0, None)}, "n": 400_000, "method": "rejection"}
    with pytest.raises(RequestError, match=r"found [\d,]+ of 400,000 scenes") as caught:
        scenegen.sample_to(path, spec, **words, timeout=1e-6)
    assert "x.parquet.part keeps what is done: go on with `resume`" in caught.value.diagnostics[0].note
    with pytest.raises(RequestError, match="`resume`"):
        scenegen.sample_to(path, spec, **words)
    with pytest.raises(RequestError, match="`seed` was 0, and is 1 now"):
        scenegen.sample_to(path, spec, **words, seed=1, resume=True)
    with pytest.raises(RequestError, match="of another request"):
        scenegen.sample_to(path, scenegen.parse(TEXT.replace("0.3", "0.31")), **words, resume=True)
    scenegen.sample_to(path, spec, **words, resume=True)
    scenegen.sample_to(tmp_path / "whole.parquet", spec, **words)
    assert path.read_bytes() == (tmp_path / "whole.parquet").read_bytes()


@pytest.mark.long
def test_what_there_is_can_be_kept(tmp_path):
    words = {"phi": {"task": (0.0, None)}, "n": 400_000, "method": "rejection", "timeout": 1e-6, "keep_partial": True}
    written = scenegen.sample_to(tmp_path / "x.jsonl", scenegen.parse(TEXT), **words)
    memory = scenegen.sample(scenegen.parse(TEXT), **words)
    assert 0 < written.count == len(memory) < 400_000
    assert written.warnings[-1].title.endswith("; these are kept") and written.warnings == memory.warnings
    read = read_scenes(tmp_path / "x.jsonl")
    assert np.array_equal(read.poses, memory.poses) and read.header == memory.header


def test_more_than_memory_is_sent_to_a_file():
    with pytest.raises(RequestError, match="too many for memory") as caught:
        scenegen.sample(scenegen.parse(TEXT), n=10_000_000)
    assert "sample_to" in caught.value.diagnostics[0].help


@pytest.mark.long
def test_the_same_path_without_processes(case):
    """What `draw` says is what `sample` says."""
    words, alone = case
    low, high = words["phi"]["task"]
    problem = make_problem(check_text(TEXT), SampleRequest({"task": Range(low, high)}, n=words["n"], seed=6))
    found = draw(problem, method=words["method"])
    assert found.rows.tobytes() == alone.poses.reshape(len(alone), -1).T.tobytes()
    assert json.loads(json.dumps(found.info)) == alone.header.sampler


@pytest.mark.slow
@pytest.mark.parametrize("name", ["table_setting", "sort_7"])
def test_workers_change_nothing_for_a_million(name, tmp_path):
    spec = scenegen.load(shipped_specs()[name])
    label = spec.labels[0]
    for workers in (1, 2, 5):
        path = tmp_path / f"{workers}.parquet"
        scenegen.sample_to(path, spec, {label: (0.0375, 0.0625)}, 1_000_000, workers=workers, timeout=600)
    one, two, five = (path.read_bytes() for path in sorted(tmp_path.iterdir()))
    assert one == two == five


LIGHT = """
import sys, scenegen
scenegen.sample(scenegen.parse("leftOf(mug, plate)"), {"task": (0.0, 0.2)}, 100, method=sys.argv[1])
heavy = {"torch", "scipy", "pyarrow", "pybullet", "pandas"} & sys.modules.keys()
assert not heavy, heavy
"""


@pytest.mark.long
@pytest.mark.parametrize("method", ["auto", "splitting"])
def test_exact_sampling_loads_nothing_heavy(method):
    """torch takes longer to load than a thousand scenes to draw, and every worker would have to load it."""
    subprocess.run([sys.executable, "-c", LIGHT, method], check=True, timeout=60)
