"""What the flow's jumps must do, beyond the contract of every model (test_contract.py)."""

import pytest
import torch

from scenegen.errors import RequestError
from scenegen.learn.models.card import Layout
from scenegen.learn.models.flow import Flow, FlowMap, departure
from scenegen.learn.models.registry import parse_hyper

LAYOUT = Layout(objects=2, labels=1, positions=(0, 1, 3), angles=(5,), branches=3)


def seeded(seed):
    return torch.Generator().manual_seed(seed)


@pytest.fixture
def flow():
    """A map with fresh weights, points of the base distribution, and a context."""
    made = FlowMap(LAYOUT, 16, 2)
    made.initialise(seeded(0))
    context = made.context(torch.linspace(-1.0, 1.0, 80).reshape(40, 2), torch.arange(40) % 3)
    return made, departure(40, LAYOUT, seeded(1), torch.device("cpu")), context


def at(value):
    return torch.full((40, 1), value)


def steer(flow, gate, shift):
    """Give every coordinate the same gate and shift, whatever the inputs."""
    last = flow.body.linear()[-1]
    with torch.no_grad():
        last.weight.zero_()
        last.bias[: flow.coordinates] = shift
        last.bias[flow.coordinates :] = gate


def test_departures_follow_the_base_distribution():
    u = departure(20_000, LAYOUT, seeded(3), torch.device("cpu"))
    assert u.shape == (20_000, LAYOUT.coordinates)
    positions, cosine, sine = u[:, :3], u[:, 3], u[:, 4]
    torch.testing.assert_close(cosine.square() + sine.square(), torch.ones(20_000))
    for column in (*positions.T, torch.atan2(sine, cosine) / torch.pi):
        shares = torch.histc(column, 10, -1.0, 1.0) / 20_000
        assert bool(((shares - 0.1).abs() < 0.015).all())  # seven standard deviations


def test_jumps_begin_where_they_are_and_end_at_their_goal(flow):
    made, x, context = flow
    torch.testing.assert_close(made.jump(x, at(0.3), at(0.3), context), x)
    assert torch.equal(made.jump(x, at(0.3), at(1.0), context), made.goal(x, at(0.3), at(1.0), context))
    half = made.jump(x, at(0.5), at(0.75), context)
    torch.testing.assert_close(half, 0.5 * (x + made.goal(x, at(0.5), at(0.75), context)))


def test_an_open_gate_leaves_everything_where_it_is(flow):
    made, x, context = flow
    steer(made, gate=1.0, shift=0.0)
    torch.testing.assert_close(made.goal(x, at(0.0), at(1.0), context), x, atol=2e-3, rtol=0.0)  # clamped off the edges


def test_a_closed_gate_computes_everything(flow):
    made, x, context = flow
    steer(made, gate=0.0, shift=0.7)
    goal = made.goal(x, at(0.0), at(1.0), context)
    torch.testing.assert_close(goal[:, :3], torch.full((40, 3), 0.7).tanh())
    torch.testing.assert_close(goal[:, 3:], torch.full((40, 2), 0.7))


def test_no_position_leaves_the_box_and_times_may_meet_at_the_end(flow):
    made, x, context = flow
    steer(made, gate=3.0, shift=50.0)
    for start, end in ((0.0, 0.4), (0.4, 1.0), (1.0, 1.0)):
        x = made.jump(x, at(start), at(end), context)
        assert bool(torch.isfinite(x).all()) and bool((x[:, :3].abs() <= 1.0).all())


def test_steps_are_jumps_from_one_time_to_the_next(make_model):
    one, three = (make_model("flow", width=16, depth=2, jumps=5, steps=steps) for steps in (1, 3))
    assert isinstance(one, Flow)
    three.load_weights(one.sampler_state())
    features, branch = one.view.features(torch.zeros(40, 2)), torch.zeros(40, dtype=torch.int64)
    x, context = departure(40, one.layout, seeded(4), torch.device("cpu")), one.flow.context(features, branch)
    torch.testing.assert_close(one.make(features, branch, seeded(4)), one.flow.jump(x, at(0.0), at(1.0), context))
    for start, end in ((0.0, 1 / 3), (1 / 3, 2 / 3), (2 / 3, 1.0)):
        x = one.flow.jump(x, at(start), at(end), context)
    torch.testing.assert_close(three.make(features, branch, seeded(4)), x)
    assert not torch.equal(one.make(features, branch, seeded(4)), x)


def test_without_jumps_a_step_is_the_midpoint_rule(make_model):
    """Of the field v(x) = -x it is x (1 - h + h^2 / 2), whatever the step."""
    model = make_model("flow", width=16, depth=2, steps=4)
    model.flow.goal = lambda x, start, end, context: x - (1.0 - start) * x
    start = departure(40, model.layout, seeded(4), torch.device("cpu"))
    features, branch = model.view.features(torch.zeros(40, 2)), torch.zeros(40, dtype=torch.int64)
    torch.testing.assert_close(model.make(features, branch, seeded(4)), start * (1.0 - 0.25 + 0.25**2 / 2) ** 4)


def test_bad_steps_are_refused():
    with pytest.raises(RequestError, match="steps"):
        parse_hyper("flow", {"steps": 0})


@pytest.mark.long
def test_training_brings_scenes_to_the_wanted_phi_in_one_jump_and_in_many(make):
    made = make("flow", 1, 1, width=32, depth=2, jumps=5)
    model, wanted = made.started(lr=5e-3), torch.tensor([-0.1])

    def errors():
        off = []
        for model.steps in (1, 8):
            off.append(float((made.spec_loss.phi(model.sample(1000, wanted, seeded(1))) - wanted).abs().mean()))
        return torch.tensor(off)

    before, generator = errors(), seeded(6)
    for batch in made.batches(200, 128):
        model.update(batch, generator)
    assert bool((errors() < 0.3 * before).all())
