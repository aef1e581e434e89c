import math

import pytest

from scenegen.errors import RequestError
from scenegen.training.config import TrainConfig


def test_defaults_are_the_papers():
    config = TrainConfig("gan")
    assert (config.epochs, config.batch_size, config.lr, config.scenes, config.data) == (
        50,
        32,
        1e-3,
        20_000,
        "uniform",
    )


@pytest.mark.parametrize("name", ["epochs", "batch_size", "scenes", "lr"])
@pytest.mark.parametrize("value", [0, -1, math.nan, math.inf, 10**12, True, "3", None])
def test_values_out_of_range_say_what_is_allowed(name, value):
    with pytest.raises(RequestError, match=rf"--{name.replace('_', '-')} is .* from .* to "):
        TrainConfig("gan", **{name: value})


def test_whole_numbers_and_seeds():
    for bad in ({"epochs": 1.5}, {"seed": -1}, {"seed": 2**63}, {"seed": 0.0}):
        with pytest.raises(RequestError, match="whole number"):
            TrainConfig("gan", **bad)
    TrainConfig("gan", seed=2**63 - 1, lr=1)


def test_names_are_checked_and_every_problem_is_told():
    with pytest.raises(RequestError) as caught:
        TrainConfig("gann", data="boost", device="gpu", epochs=0)
    text = str(caught.value)
    assert len(caught.value.diagnostics) == 4
    assert "did you mean `gan`" in text and "did you mean `boosted`" in text and "`cuda`" in text


def test_differences_leave_the_epochs_out():
    mine, theirs = TrainConfig("gan", epochs=3, seed=1), TrainConfig("gan", epochs=9, seed=2)
    assert mine.differences(theirs) == [("seed", 1, 2)]
