"""Growth for many cells of a range at once."""

import numpy as np
import pytest

import scenegen


@pytest.mark.slow
def test_choices_in_a_bounded_range():
    """Each way of a choice has ends of its own for every cell."""
    spec = scenegen.parse(
        "object a, b, c\nrequire noOverlap()\n"
        "task: closeTo(a, b, 30 cm) & closeTo(b, c, 30 cm) | farFrom(a, b, 50 cm) & farFrom(b, c, 50 cm)\n"
    )
    scenes = scenegen.sample(spec, {"task": (-0.1, 0.0)}, 64, method="growth", timeout=60.0)
    values = scenes.phi["task"]
    assert ((values >= -0.1) & (values <= 0.0)).all()
    assert np.histogram(values, bins=4, range=(-0.1, 0.0))[0].min() >= 8
