import math

import pytest

from scenegen.errors import RequestError
from scenegen.learn.models.registry import RECIPES
from scenegen.learn.training.config import make_config


def test_the_papers_recipe():
    config = make_config("gan", "paper")
    assert (config.epochs, config.batch_size, config.lr, config.scenes, config.data) == (
        50,
        32,
        1e-3,
        20_000,
        "uniform",
    )


@pytest.mark.parametrize("name", ["epochs", "batch_size", "scenes", "lr"])
@pytest.mark.parametrize("value", [0, -1, math.nan, math.inf, 10**12, True, "3"])
def test_values_out_of_range_say_what_is_allowed(name, value):
    with pytest.raises(RequestError, match=rf"`{name}` is .*\n.* from .* to "):
        make_config("gan", **{name: value})


@pytest.mark.parametrize(("recipe", "model"), [(recipe, model) for recipe in RECIPES for model in RECIPES[recipe]])
def test_every_entry_has_settings(recipe, model):
    config = make_config(model, recipe)
    assert (config.model, config.recipe) == (model, recipe)
    rates = [config.rate(step, 1000) for step in range(1001)]
    assert max(rates) <= config.lr and min(rates) > 0.0
    if recipe == "paper":
        assert set(rates) == {config.lr}
    else:
        assert rates[0] < rates[199] > rates[999] and rates[1000] == pytest.approx(0.01 * config.lr)


def test_names_that_are_nowhere():
    for words, text in (
        (("gann",), "did you mean `gan`"),
        (("gan", "papr"), "did you mean `paper`"),
        (("energy", "paper"), "unknown model `energy`\n.*the models of the paper recipe"),
    ):
        with pytest.raises(RequestError, match=text):
            make_config(*words)


def test_left_out_and_none_are_the_recipes_own():
    assert make_config("gan", "paper", epochs=None, lr=None) == make_config("gan", "paper")


def test_whole_numbers_and_seeds():
    for bad in ({"epochs": 1.5}, {"seed": -1}, {"seed": 2**63}, {"seed": 0.0}):
        with pytest.raises(RequestError, match="whole number"):
            make_config("gan", **bad)
    make_config("gan", seed=2**63 - 1, lr=1)


def test_names_are_checked_and_every_problem_is_told():
    with pytest.raises(RequestError) as caught:
        make_config("gan", data="boost", device="gpu", epochs=0)
    text = str(caught.value)
    assert len(caught.value.diagnostics) == 3
    assert "did you mean `boosted`" in text and "`cuda`" in text


def test_differences_leave_the_epochs_out():
    mine, theirs = make_config("gan", epochs=3, seed=1), make_config("gan", epochs=9, seed=2)
    assert mine.differences(theirs) == [("seed", 1, 2)]
