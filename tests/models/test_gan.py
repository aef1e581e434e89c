"""What only the default GAN has: the error of phi comes in after a start. How it learns is in test_games.py."""

import pytest
import torch

from scenegen.learn.models.games import START


def pushes(make, done, **hyper):
    """How hard the first step pushes the generator's last bias, with so many steps already done."""
    made = make("gan", 2, 1, **hyper)
    model = made.started(lr=1e-3)
    model.steps.fill_(done)
    (batch,) = made.batches(1, 64)
    model.update(batch, torch.Generator().manual_seed(3))
    return model.generator.body.linear()[-1].bias.grad.clone()


@pytest.mark.parametrize(("done", "share"), [(0, START), (49, 0.5), (99, 1.0), (5_000, 1.0)])
def test_the_error_of_phi_comes_in_after_a_start(make, done, share):
    without = pushes(make, done, ramp=100, consistency=0.0)
    whole = pushes(make, 0, ramp=1, consistency=2.0) - without
    part = pushes(make, done, ramp=100, consistency=2.0) - without
    assert whole.norm() > 0.0
    torch.testing.assert_close(part, share * whole, rtol=1e-3, atol=1e-6)


def test_steps_are_counted_where_resume_finds_them_and_left_out_of_the_file(make):
    made = make("gan", 2, 1)
    model = made.started()
    for batch in made.batches(3, 4):
        model.update(batch, torch.Generator().manual_seed(3))
    assert model.training_state()["model.steps"] == 3
    assert {name.partition(".")[0] for name in model.sampler_state()} == {
        *("generator", "selector", "view", "label_lowest", "label_highest", "label_scale")
    }
