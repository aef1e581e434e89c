"""Nasty specs over time: whatever is asked, the answer comes in time, within the memory of a small machine."""

import gc
import importlib
import time
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.sampling.motions.scores import make_motion_problem
from scenegen.sampling.request import SampleRequest
from scenegen.search.effort import StoppedError

LIMIT, ROOM = 0.5, 4.0
CHECK = 4.0  # CPU seconds of checking a spec, whose pairs are expanded one by one
MEMORY = 1.5e9

SPECS = {path.stem: path.read_text() for path in sorted((Path(__file__).parent / "nasty").glob("*.spec"))}


def answered(text, call):
    """Runs `call` on a spec for its CPU seconds, which other work on the machine hardly changes, and on another that is
    as new for its bytes: counting these takes several times as long."""
    spec = scenegen.parse(text)
    gc.collect()
    began = time.process_time()
    found = _outcome(call, spec)
    took = time.process_time() - began
    assert took < ROOM * (LIMIT + 1.0), f"{took:.1f} s"
    spec = scenegen.parse(text)
    tracemalloc.start()
    _outcome(call, spec)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < MEMORY, f"{peak / 1e9:.1f} GB"
    return found


def _outcome(call, spec):
    try:
        return call(spec)
    except RequestError as refused:
        return refused


def test_there_are_nasty_specs():
    assert len(SPECS) >= 12


@pytest.mark.long
@pytest.mark.parametrize("name", SPECS)
def test_motions_are_drawn_or_refused_in_time(name):
    began = time.process_time()
    scenegen.parse(SPECS[name])
    assert time.process_time() - began < CHECK
    tracemalloc.start()
    spec = scenegen.parse(SPECS[name])
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < MEMORY
    phi = {spec.labels[0]: (0.0, None)}
    found = answered(
        SPECS[name], lambda spec: scenegen.sample_motions(spec, phi, 50, seed=1, timeout=LIMIT, keep_partial=True)
    )
    if isinstance(found, RequestError):
        codes = {one.code for one in found.diagnostics}
        assert codes <= {"no-time-to-tell", "no-time-to-check", "too-few-motions", "beyond-bounds"}, codes
    else:
        assert (found.phi[spec.labels[0]] >= 0.0).all()


@pytest.mark.long
@pytest.mark.parametrize("name", ["crowd", "long", "rare"])
def test_ranges_with_two_ends_and_each_method(name):
    for method in ("rejection", "splitting"):
        answered(
            SPECS[name],
            lambda spec, method=method: scenegen.sample_motions(
                spec, {spec.labels[0]: (-0.3, -0.1)}, 20, seed=1, timeout=LIMIT, method=method, keep_partial=True
            ),
        )


@pytest.mark.parametrize("name", ["long", "rare"])
def test_training_refuses_a_spec_over_time_at_once(name, tmp_path):
    importlib.import_module("scenegen.learn.train")  # the import of torch is not measured
    importlib.import_module("torch")
    found = answered(SPECS[name], lambda spec: scenegen.train(spec, out=tmp_path / "model.safetensors"))
    assert isinstance(found, RequestError) and {one.code for one in found.diagnostics} == {"time-not-here"}


def test_large_motions_are_scored_in_groups_with_looks_at_the_time():
    """The same values, and a stop is heeded between groups."""
    problem = make_motion_problem(scenegen.parse(SPECS["wide"]).definition, SampleRequest({}, 1))
    assert problem.batch_size(4096, 8) < 64 < problem.batch_size(4096, 64) + 1
    rng = np.random.default_rng(0)
    poses = rng.random((2, 3, problem.steps + 1, 100))

    class Looks:
        count, most = 0, 1000

        def check(self):
            self.count += 1
            if self.count > self.most:
                raise StoppedError

    looks = Looks()
    with np.errstate(all="ignore"):
        found = problem.scores(poses, looks)
        assert looks.count >= 1
        single = np.concatenate([problem.scores(poses[..., k : k + 1]) for k in (0, 57, 99)], axis=1)
        assert np.array_equal(found[:, [0, 57, 99]], single)
        looks.count, looks.most = 0, 0
        with pytest.raises(StoppedError):
            problem.scores(poses, looks)


def test_usual_motions_are_drawn_in_groups_of_the_usual_size():
    """So seeds give what they gave before large motions were heeded."""
    text = (
        "object a, b, c, d, e\ntime 20 steps\nrequire forall p in objects: speed(p) <= 10 cm/s\nrequire noOverlap()\n"
    )
    spec = scenegen.parse(text + "task: (always farFrom(a, b, 10 cm)) & (closeTo(a, c) until closeTo(d, e))")
    problem = make_motion_problem(spec.definition, SampleRequest({}, 1))
    assert problem.batch_size(4096, 8) == 4096
