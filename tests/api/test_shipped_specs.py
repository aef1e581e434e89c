"""The specs that ship: each says what it describes, and each can be sampled, every label satisfied where asked."""

from pathlib import Path

import numpy as np
import pytest

import scenegen

ROOT = Path(__file__).resolve().parents[2]
SPECS = sorted((ROOT / "specs").glob("*.spec"))
# seconds each; tests/sampling and tests/physics sample supports, headings and full tables with smaller ones
LONG = dict.fromkeys(
    ["block_tower", "pantry_shelf", "served_pot", "sushi_plate", "tidy_desk", "toolbox_drawer"], pytest.mark.slow
)


def test_there_is_something_to_start_from():
    assert len(SPECS) >= 18


@pytest.mark.long
@pytest.mark.parametrize("path", SPECS, ids=lambda path: path.stem)
def test_described(path):
    spec = scenegen.load(path)
    assert len(spec.checked.title) > 20 and spec.checked.title.endswith((".", ")"))
    wraps = path.stem != "table_setting_published"  # the published code does not
    assert [one.title.split(":")[0] for one in spec.warnings] == (
        [] if wraps else ["a heading is compared as a number"]
    )
    assert spec.infeasible() == []


@pytest.mark.long
@pytest.mark.parametrize(
    "path", [pytest.param(path, marks=LONG.get(path.stem, ())) for path in SPECS], ids=lambda path: path.stem
)
def test_sampled(path):
    spec = scenegen.load(path)
    for label in spec.labels:
        scenes = scenegen.sample(spec, {label: (0.0, None)}, n=4, seed=1)
        assert len(scenes) == 4 and np.all(scenes.phi[label] >= 0.0)
        again = scenegen.api.scenes.evaluate(spec.checked, scenes)
        np.testing.assert_array_equal(again[label], scenes.phi[label])
        margin = scenegen.api.scenes.requirement(spec.checked, scenes)
        assert margin is None or np.all(margin >= 0.0)
