"""Growth for many cells of a range at once."""

import numpy as np

import scenegen


def test_choices_in_a_bounded_range():
    """Each way of a choice has ends of its own for every cell; rooms have several branches, too."""
    spec = scenegen.parse(
        "object p[5] = box(0.06, 0.05, 0.05), q[2] = box(0.05, 0.05, 0.05)\n"
        "require noOverlap()\n"
        "task: forall i in p: exists j in q: closeTo(i, j, 20 cm) | farFrom(i, j, 60 cm)\n"
    )
    scenes = scenegen.sample(spec, {"task": (-0.1, 0.0)}, 64, method="growth", timeout=60.0)
    values = scenes.phi["task"]
    assert ((values >= -0.1) & (values <= 0.0)).all()
    assert np.histogram(values, bins=4, range=(-0.1, 0.0))[0].min() >= 8
