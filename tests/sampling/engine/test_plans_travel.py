"""A plan can be sent anywhere: read back in a new process, each kind draws the same pieces, bit for bit."""

import base64
import json
import pickle
import subprocess
import sys
import time
from contextlib import closing

import pytest

import scenegen
from scenegen.api.request import check_request
from scenegen.api.spec import model_of, spec_of
from scenegen.sampling.methods import METHODS
from scenegen.sampling.plans import plan_for
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget

WAVE = "sin(20 * theta({})) >= 0.9"
TEXT = "object mug, plate, cup\nrequire farFrom(mug, plate, 0.1)\ntask: leftOf(mug, plate) & closeTo(cup, mug, 0.3)\n"
APART = f"object a, b\ntask: {WAVE.format('a')} & x(a) + y(a) >= 1 & {WAVE.format('b')} & x(b) * y(b) >= 0.1"
FLAT = {"task": Range(0.02, 0.2)}
EXACT = [name for name, method in METHODS.items() if not method.proposes and name not in ("auto", "any")]
# kind of plan -> the words of its request
KINDS = {
    **{name: {"method": name} for name in EXACT},
    "paired": {},
    "settled": {"settle": True},
    "model": {"method": "model"},
    "raw": {"method": "model", "raw": True},
    "settled model": {"method": "model", "settle": True},
    "any": {"method": "any"},
}
OF_A_MODEL = list(KINDS)[-4:]

PROGRAM = """
import base64, hashlib, json, pickle, sys
from contextlib import closing
for line in sys.stdin:
    name, data = json.loads(line)
    plan = pickle.loads(base64.b64decode(data))
    before = "torch" in sys.modules
    with closing(plan):
        piece = plan.draw(1)
    parts = [one.tobytes() for one in (piece.rows, piece.phi, piece.cell, piece.facts)]
    print(json.dumps([name, hashlib.sha256(b"".join(parts)).hexdigest(), before, "torch" in sys.modules]), flush=True)
"""


@pytest.fixture(scope="module")
def model(tmp_path_factory):
    out = tmp_path_factory.mktemp("model") / "m.safetensors"
    made = scenegen.train(scenegen.parse(TEXT), "gan", data="uniform", out=out, epochs=1, scenes=64, card=False)
    out.unlink()  # plans have the model with them
    return made


@pytest.fixture(scope="module")
def plans(model):
    """Plans by kind."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("scenegen.sampling.growth.sampler.MIN_POPULATION", 128)
        patch.setattr("scenegen.sampling.growth.sampler.MAX_POPULATION", 256)
        patch.setattr("scenegen.sampling.splitting.sampler.MAX_CHAINS", 256)
        patch.setattr("scenegen.sampling.splitting.sampler.MIN_CHAINS", 256)
        return {kind: _plan(kind, model) for kind in KINDS}


def _plan(kind, model):
    source = model if kind in OF_A_MODEL and kind != "any" else model.spec
    request = SampleRequest(FLAT, 20, **KINDS[kind], workers=1)
    if kind == "paired":
        return _paired()
    return plan_for(spec_of(source).definition, check_request(source, request), Budget(600.0), model_of(source))


def _paired():
    from scenegen.lang.checker import check_text
    from scenegen.sampling.parts import independent_parts, pair
    from scenegen.sampling.plans import make_plan
    from scenegen.sampling.problem import make_problem

    problem = make_problem(check_text(APART), SampleRequest({"task": Range(0.0)}, 20))
    parts = independent_parts(problem, Budget(600.0))
    assert len(parts) == 2
    return pair(problem, parts, [make_plan(part.problem, Budget(600.0), method="rejection") for part in parts])


@pytest.mark.long
def test_a_plan_draws_the_same_in_a_new_process(plans):
    import hashlib

    lines = [json.dumps([kind, base64.b64encode(pickle.dumps(plan)).decode()]) for kind, plan in plans.items()]
    run = subprocess.run([sys.executable, "-c", PROGRAM], input="\n".join(lines), capture_output=True, text=True)
    assert run.returncode == 0, run.stderr
    answers = [json.loads(line) for line in run.stdout.splitlines()]
    assert [kind for kind, *_ in answers] == list(KINDS)
    for kind, digest, before, after in answers:
        with closing(plans[kind]) as plan:
            piece = plan.draw(1)
        assert len(piece.cell) and len(piece.rows.T) == len(piece.cell)
        parts = [one.tobytes() for one in (piece.rows, piece.phi, piece.cell, piece.facts)]
        assert hashlib.sha256(b"".join(parts)).hexdigest() == digest, kind
        # exact plans do without torch, the first of a model loads it when it is read
        assert before == after == (kind in OF_A_MODEL), kind


def test_what_is_left_of_the_time_travels_with_a_plan():
    """The clock of another machine may be any: it gets the seconds that are left."""
    now = time.monotonic()
    again = pickle.loads(pickle.dumps(Budget(100.0, started=now - 40.0)))  # noqa: S301 - our own
    assert now <= again.started < now + 10.0 and 50.0 < again.seconds <= 60.0


@pytest.fixture
def words(monkeypatch):
    """A request that takes a model's plan several pieces."""
    monkeypatch.setattr("scenegen.learn.guided.LARGEST", 1024)
    return {"phi": {"task": (-0.4, 0.2)}, "n": 3000, "seed": 3}


@pytest.mark.long
def test_a_models_scenes_are_the_same_on_two_processes(model, words):
    alone, shared = (scenegen.sample(model, **words, workers=workers) for workers in (1, 2))
    assert alone.poses.tobytes() == shared.poses.tobytes() and alone.header == shared.header


@pytest.mark.long
@pytest.mark.parametrize("raw", [False, True])
def test_a_models_run_goes_on_where_it_was_broken_off(model, words, raw, tmp_path):
    calls = iter(range(100))

    def progress(*_):
        if next(calls):
            raise KeyboardInterrupt

    whole = scenegen.sample(model, **words, raw=raw, workers=1)
    whole.save(tmp_path / "whole.jsonl")
    with pytest.raises(KeyboardInterrupt, match="go on with `resume`"):
        scenegen.sample_to(tmp_path / "broken.jsonl", model, **words, raw=raw, workers=1, progress=progress)
    scenegen.sample_to(tmp_path / "broken.jsonl", model, **words, raw=raw, workers=1, resume=True)
    assert (tmp_path / "broken.jsonl").read_bytes() == (tmp_path / "whole.jsonl").read_bytes()
