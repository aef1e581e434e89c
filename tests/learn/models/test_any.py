"""The model of any spec: what is asked of it is answered as by other models, or refused with the reason."""

import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import scenegen
from scenegen.errors import DataError, RequestError
from scenegen.errors.learning import NOT_MEASURED, POOR_MODEL, UNKNOWN_TO_MODEL
from scenegen.errors.requests import OUT_OF_TIME
from scenegen.geometry import PRIMITIVES
from scenegen.learn import any as any_model
from scenegen.learn.any import compare_scenes, exact_scenes, left_out
from scenegen.learn.guided import make_plan
from scenegen.learn.models.card import MODEL_FORMAT
from scenegen.learn.models.checkpoint import load_model, pack, unpack
from scenegen.learn.models.codec import ways_of
from scenegen.learn.models.frames import frames_of
from scenegen.learn.models.graph import PRIMITIVE_NAMES, graph_of
from scenegen.learn.models.graph_flow import shipped_weights
from scenegen.sampling.problem import make_problem
from scenegen.sampling.request import Range, SampleRequest
from scenegen.search.effort import Budget, StoppedError

TEXT = """object plate, mug, bowl
require noOverlap()
goal: leftOf(mug, plate) & (closeTo(mug, plate, 20 cm) | closeTo(bowl, plate, 25 cm))
"""


@pytest.fixture(scope="module")
def spec():
    return scenegen.parse(TEXT)


@pytest.mark.long
def test_its_scenes_are_verified_and_repeat(spec, monkeypatch):
    monkeypatch.setattr(any_model, "EXACT_SECONDS", 10.0)  # a busy machine finds few exact scenes in half a second
    scenes = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=300, method="any", seed=4)
    assert len(scenes) == 300 and all(-0.1 <= one <= 0.0 for one in scenes.phi["goal"])
    assert scenes.header.sampler["method"] == "model" and scenes.header.sampler["model"] == "any"
    again = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=300, method="any", seed=4, workers=2)
    assert np.array_equal(scenes.poses, again.poses)
    model = scenegen.load_model("any", spec)
    assert np.array_equal(scenes.poses, scenegen.sample(model, {"goal": (-0.1, 0.0)}, n=300, seed=4).poses)
    other = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=300, method="any", seed=5)
    assert not np.array_equal(scenes.poses, other.poses)


@pytest.mark.long
def test_its_scenes_go_into_files_and_are_judged(spec, tmp_path):
    written = scenegen.sample_to(tmp_path / "a.parquet", spec, {"goal": (0.0, None)}, n=500, method="any")
    assert written.count == 500 and scenegen.read_scenes(tmp_path / "a.parquet").phi["goal"].min() >= 0.0


@pytest.mark.long
def test_raw_scenes_are_near_their_phi(spec):
    model = scenegen.load_model("any", spec)
    wanted = torch.full((1, 500), -0.05)
    rows = model.trained.propose(wanted, torch.Generator().manual_seed(0))
    phi = spec.robustness().rows(rows)[0]
    assert float((phi + 0.05).abs().mean()) < 0.01
    assert scenegen.sample(model, {"goal": (-0.1, 0.0)}, n=50, raw=True).header.sampler["raw"] is True


@pytest.mark.long
def test_it_does_not_wait_for_sympy():
    """torch imports it, which takes half a second, where slopes are given to begin with."""
    program = (
        f"import sys, scenegen; scenegen.sample(scenegen.parse({TEXT!r}), n=10, method='any'); print(*sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert "torch" in done.stdout.split() and "sympy" not in done.stdout.split()


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("time 10 steps\nobject mug, plate\ngoal: eventually leftOf(mug, plate)\n", "single scenes"),
        ("object mugs[1..3]\nobject plate\ngoal: forall m in mugs: leftOf(m, plate)\n", "number"),
        ("object tray, book\nobject mug on any of [tray, book]\ngoal: leftOf(mug, book)\n", "surface"),
    ],
)
def test_what_it_does_not_take_is_refused(text, why):
    with pytest.raises(RequestError, match=why):
        scenegen.load_model("any", scenegen.parse(text))


class _Clock:
    """Goes on by a second whenever it is looked at."""

    def __init__(self):
        self.now = time.monotonic()

    def __call__(self):
        self.now += 1.0
        return self.now


WIDE = "object a[12]\nrequire noOverlap()\ngoal: forall p in a: exists q in a: p != q & closeTo(p, q, 4 cm)\n"


@pytest.mark.long
@pytest.mark.parametrize("seconds", [5, 100, 1_000, 3_000, 9_000])
def test_a_limit_of_time_holds_wherever_it_is_met(seconds, monkeypatch):
    """While phi is measured, while the graph is made, the network is evaluated, scenes are corrected: one answer, and
    few looks at the clock after it is over."""
    clock = _Clock()
    over = clock.now + seconds
    monkeypatch.setattr(time, "monotonic", clock)
    with pytest.raises(RequestError) as caught:
        scenegen.sample(scenegen.parse(WIDE), {"goal": (0.005, 0.006)}, n=10_000, method="any", timeout=seconds)
    [problem] = caught.value.diagnostics
    assert problem.kind in OUT_OF_TIME and "timeout" in problem.help
    assert clock.now - over < 50.0


def test_a_proposal_ends_when_it_is_told_to(spec):
    """After whichever look at the clock; and when it is not, its scenes are the same."""
    model = scenegen.load_model("any", spec).trained
    wanted = torch.full((1, 64), -0.05)

    class Calls:
        def __init__(self, most):
            self.most, self.made = most, 0

        def check(self):
            self.made += 1
            if self.made == self.most:
                raise StoppedError

    def rows(stop):
        return model.propose(wanted, torch.Generator().manual_seed(0), stop)

    all_of_it = Calls(0)
    assert torch.equal(rows(all_of_it), model.propose(wanted, torch.Generator().manual_seed(0)))
    assert all_of_it.made > 40, "evaluations of the network, Newton steps, random moves"
    for most in (1, 2, 4, 10, all_of_it.made):
        stop = Calls(most)
        with pytest.raises(StoppedError):
            rows(stop)
        assert stop.made == most


def test_scenes_that_are_not_found_in_time_have_no_reason(spec):
    """Candidates that would tell which atom fails cannot be drawn any more (this was an internal error)."""
    checked = spec.checked
    asked = SampleRequest({"goal": Range(-0.5, None)}, 8, spread="base", workers=1)
    plan = make_plan(make_problem(checked, asked), Budget(), scenegen.load_model("any", spec).trained)
    rows, phi = replace(plan, stop=Budget(0.0, started=0.0)).misses()
    assert rows.shape == (9, 0) and phi.shape == (2, 0)


NEW = """
from dataclasses import replace
from scenegen.geometry import PRIMITIVES
if {known}:
    PRIMITIVES["aGap"] = replace(PRIMITIVES["gap"], name="aGap")
import scenegen
print(scenegen.sample(scenegen.parse({text!r}), {{"goal": (-0.1, 0.0)}}, n=4, method="any", raw=True).poses.tolist())
"""


@pytest.mark.long
def test_a_new_primitive_changes_nothing_where_it_is_not_used():
    """It is first in the order of names: the inputs of weights that do not know it would all be others."""

    def said(text, known):
        words = [sys.executable, "-c", NEW.format(text=text, known=known)]
        return subprocess.run(words, capture_output=True, text=True, check=False)

    text = "object mug, plate\ngoal: gap(mug, plate) >= 3 cm\n"
    assert said(text, True).stdout == said(text, False).stdout != ""
    refused = said(text.replace("gap", "aGap"), True)
    assert "[unknown-to-model]: the weights of this model do not know `aGap`" in refused.stderr


def test_a_primitive_that_was_renamed_is_refused_by_name(spec):
    """As where the weights' file has another name for it."""
    with pytest.raises(RequestError, match="do not know `gap`") as caught:
        graph_of(frames_of(spec.checked), PRIMITIVE_NAMES.replace("gap", "clearance"))
    assert caught.value.diagnostics[0].kind is UNKNOWN_TO_MODEL


def test_formulas_of_primitives_that_the_weights_do_not_know_are_refused():
    seen = scenegen.parse(
        "camera front = at (0.5, -0.6, 0.7) looks at (0.5, 0.4, 0) fov 60 deg, 4:3\n"
        "object mug, bottle\ntask: unhidden(mug, front)\n"
    )
    with pytest.raises(RequestError, match="do not know `shadowGap`"):
        scenegen.sample(seen, (0.0, None), 2, method="any")


def test_a_spec_that_says_where_things_usually_are_is_refused():
    usual = scenegen.parse("object mug, plate\nusually mug ~ normal(plate, 5 cm)\ntask: leftOf(mug, plate)")
    with pytest.raises(RequestError, match="where things usually are") as caught:
        scenegen.load_model("any", usual)
    assert caught.value.diagnostics[0].kind is UNKNOWN_TO_MODEL


def test_files_name_the_primitives_that_their_weights_know(spec):
    trained = scenegen.load_model("any", spec).trained
    text, tensors = unpack(Path("m"), MODEL_FORMAT, "a model file", trained.data)
    card = json.loads(text)
    known = shipped_weights()[0].hyper["primitives"]
    assert card["hyper"]["primitives"] == known == PRIMITIVE_NAMES
    assert {*PRIMITIVES}.difference(known.split()) == {
        "pathGap",
        "quantile",
        "shadowGap",
        "visibleShare",
    }  # younger than the weights
    wanted = torch.full((1, 16), -0.05)

    def read(names):
        """The scenes of the same file with these names in it."""
        hyper = {name: value for name, value in card["hyper"].items() if name != "primitives"} | names
        data = pack(MODEL_FORMAT, json.dumps({**card, "hyper": hyper}), tensors)
        return load_model(Path("m"), data=data).propose(wanted, torch.Generator().manual_seed(0))

    assert torch.equal(read({}), read({"primitives": PRIMITIVE_NAMES})), (
        "a file of an earlier version, with the names of then"
    )
    with pytest.raises(RequestError, match="do not know `gap`"):
        read({"primitives": PRIMITIVE_NAMES.replace("gap", "clearance")})
    with pytest.raises(DataError, match=r"goal\.atom_kind"):
        read({"primitives": f"{PRIMITIVE_NAMES} wider"})


def test_it_has_to_be_told_of_which_spec():
    with pytest.raises(RequestError, match="of which spec"):
        scenegen.load_model("any")


def test_a_part_that_is_left_out_is_named(spec):
    request = SampleRequest({"goal": Range(-0.05, 0.05)}, 400, seed=1, spread="base")
    exact, _ = exact_scenes(spec.checked, request)
    assert left_out(spec.checked, exact, exact) == "" and compare_scenes(spec.checked, exact, exact, "goal") == []
    decides = ways_of(spec.checked, torch.from_numpy(exact))[0].numpy()
    texts = [getattr(spec.checked.core.nodes[node], "text", "") for node in decides]
    kept = exact[:, [not text.startswith("closeTo(bowl") for text in texts]]
    assert 100 < kept.shape[1] < 0.95 * exact.shape[1]
    said = left_out(spec.checked, exact, kept)
    assert said.startswith("`closeTo(bowl, plate, 0.25)` decides `goal` in 0% of them")
    found = compare_scenes(spec.checked, exact, kept, "goal=-0.05:0.05")
    assert found and {one.kind for one in found} == {POOR_MODEL} and said in found[-1].title


@pytest.mark.long
def test_it_says_where_it_could_not_be_compared(spec, monkeypatch):
    model = scenegen.load_model("any", spec)
    looked = []
    monkeypatch.setattr(
        any_model, "exact_scenes", lambda *asked: looked.append(asked) or (np.empty((9, 0)), np.empty((1, 0)))
    )
    satisfied = {"goal": Range(0.0, None)}
    model.proposer_of(spec.checked, satisfied)
    [said] = model.advice(SampleRequest(satisfied, 10), None)
    assert said.kind is NOT_MEASURED and len(looked) == 1, "what is too rare is not looked for twice"


def test_the_card_of_the_weights():
    card, weights = shipped_weights()
    assert card.steps > 0 and card.specs > 0 and sum(one.numel() for one in weights.values()) < 3_000_000
    assert all(bool(torch.isfinite(one).all()) for one in weights.values())


@pytest.mark.long
def test_it_can_be_tuned_to_one_spec(spec, tmp_path):
    model = scenegen.train(spec, "any", out=tmp_path / "m.safetensors", scenes=600, epochs=1)
    assert model.name == "any" and model.trained.card.epochs_done == 1
    again = scenegen.load_model(tmp_path / "m.safetensors", spec)
    scenes = scenegen.sample(again, {"goal": (-0.1, 0.0)}, n=50)
    assert len(scenes) == 50 and json.loads(json.dumps(scenes.header.sampler))["model"] == "any"
    fresh = shipped_weights()[1]["goal.made.weight"]
    assert not torch.equal(again.trained.model.networks.goal.made.weight, fresh)


@pytest.mark.long
def test_with_what_is_held_it_is_compared_with_what_is_held(spec, monkeypatch):
    monkeypatch.setattr(any_model, "EXACT_SECONDS", 10.0)  # a busy machine finds few exact scenes in half a second
    held = {"plate": (0.3, 0.7)}
    scenes = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=400, method="any", fix=held)
    assert np.allclose(scenes.poses[:, 0, :2], (0.3, 0.7))
    # networks do not know what a request holds, and it is said that this shows
    assert [one.kind for one in scenes.warnings] == [POOR_MODEL]
    free = scenegen.sample(spec, {"goal": (-0.1, 0.0)}, n=400, method="any")
    assert free.warnings == ()
