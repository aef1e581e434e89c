"""Scoring specs by their texts."""

import random

from scenegen.errors import SpecError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import gate
from scenegen.lang.formula.interpret import phi


def worth(text, *poses, label="task"):
    """phi of a label in a scene; `label="require"` for what the spec requires."""
    return phi(gate(check_text(text).core), [value for pose in poses for value in pose])[label]


def scenes(spec, count=20, seed=0):
    """Random rows of coordinates in the spec's box."""
    rng = random.Random(seed)
    lowest, highest = spec.box()
    return [[rng.uniform(low, high) for low, high in zip(lowest, highest, strict=True)] for _ in range(count)]


def alike(one, other):
    """Whether two texts have the same objects and labels and are worth the same, to the last bit, in many scenes."""
    first, second = check_text(one), check_text(other)
    assert first.objects == second.objects
    assert first.fixed == second.fixed
    cores = gate(first.core), gate(second.core)
    assert list(cores[0].labels) == list(cores[1].labels)
    for rows in scenes(first):
        assert phi(cores[0], rows) == phi(cores[1], rows), rows
    return True


def problems(text):
    """The titles of what is wrong with a text; [] where nothing is."""
    try:
        check_text(text)
    except SpecError as refused:
        return [one.title for one in refused.diagnostics]
    return []


def warnings(text):
    return [(one.title, one.span.text) for one in check_text(text).warnings]
