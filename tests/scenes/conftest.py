"""A small scene file as data, and as bytes."""

import pytest

from scenegen.api.sample import sample
from scenegen.api.spec import parse

SPEC = "# A mug by a plate.\nobject mug, plate\ntask: leftOf(mug, plate) & !closeTo(mug, plate, 0.25)\n"


@pytest.fixture(scope="session")
def scenes():
    return sample(parse(SPEC, "mug.spec"), {"task": (0.0, 0.2)}, n=4, seed=7)


@pytest.fixture(scope="session")
def written(scenes):
    from scenegen.scenes.formats.scenes_json import dump

    return dump(scenes.file())
