"""The table of experiments: every entry loads, and is told to people."""

import importlib
import inspect

import pytest

from experiments.table import ALL, EXPERIMENTS, chosen
from scenegen.errors import RequestError


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_entry_is_a_function_of_a_plan(name):
    module, _, function = EXPERIMENTS[name].function.partition(":")
    assert list(inspect.signature(getattr(importlib.import_module(module), function)).parameters) == ["plan"]


def test_one_by_name_or_all():
    assert list(chosen("exp1")) == ["exp1"]
    assert chosen(ALL) == EXPERIMENTS


def test_a_misspelt_name_is_answered():
    with pytest.raises(RequestError) as caught:
        chosen("semantic")
    [diagnostic] = caught.value.diagnostics
    assert diagnostic.title == "unknown experiment `semantic`" and diagnostic.help == "did you mean `semantics`?"
