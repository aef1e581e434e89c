"""Models on the page: which one draws the scenes of a message."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.show.view.jobs import sample
from scenegen.show.view.jobs.source import spec_of

TEXT = "object block[1..3], plate\ntask: leftOf(block[1], plate)\n"


@pytest.fixture
def folder(monkeypatch):
    """A folder of models, as far as they are looked at."""
    models = [(numbers, SimpleNamespace(spec=member)) for numbers, member in scenegen.parse(TEXT).members]
    monkeypatch.setattr(sample, "_model", lambda path: SimpleNamespace(each=models))
    return {numbers["block"]: model for numbers, model in models}


@pytest.mark.parametrize("number", [1, 2, 3])
def test_a_folder_of_models_has_one_for_each_number_of_things(folder, tmp_path, number):
    spec = spec_of({"root": str(tmp_path), "text": TEXT, "counts": {"block": number}})
    assert sample._model_of("models", spec) is folder[number]


def test_a_model_of_another_spec_is_refused(folder, tmp_path):
    spec = spec_of({"root": str(tmp_path), "text": TEXT.replace("leftOf", "rightOf")})
    with pytest.raises(RequestError, match="another"):
        sample._model_of("models", spec)
