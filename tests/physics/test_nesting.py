"""Every round thing of the library on every other that the language lets it stand on: it stays where it is planned. On
plates and in bowls, everything."""

from functools import cache

import pytest

import scenegen
from scenegen.errors import SpecError
from scenegen.lang.checker import check_text
from scenegen.things import ASSETS, Circle, shape_of
from scenegen.things.surfaces import nested

ROUND = [name for name, asset in ASSETS.items() if isinstance(asset.footprint, Circle)]
CRATES = ["tray", "carton", "bin"]
SPACING = 0.8  # metres


@cache
def carried(lower):
    """What `a on b` lets stand on an object: round things, and in shallow vessels all."""
    found = []
    for upper in ASSETS if lower in ("plate", "bowl") else ROUND:
        try:
            check_text(f"object {lower}_1, {upper}_2 on {lower}_1\ntask: x({upper}_2) >= 0 m")
        except SpecError:
            continue
        found.append(upper)
    return found


def scenes_of(lower, n):
    """n scenes of all pairs, side by side."""
    lines, rules = [], []
    for number, upper in enumerate(carried(lower)):
        under, over = f"{lower}_{2 * number + 1}", f"{upper}_{2 * number + 2}"
        place = f"({SPACING * (number % 6 + 0.5)}, {SPACING * (number // 6 + 0.5)}, {25 * number} deg)"
        lines.append(f"object {under} at {place}, {over} on {under}")
        rules.append(f"apart({over}, {under}) >= 0 & stable([{over}])")
    side = 6.0 * SPACING
    text = "\n".join([f"workspace [0, {side}] x [0, {side}]", *lines, f"require {' & '.join(rules)}"])
    return scenegen.sample(scenegen.parse(f"{text}\ntask: x({carried(lower)[0]}_2) >= 0 m"), n=n, seed=3)


@pytest.mark.long
@pytest.mark.parametrize("simulator", ["mujoco", "pybullet"])
@pytest.mark.parametrize("lower", [name for name in [*ROUND, *CRATES] if carried(name)])
def test_pairs_settle_where_they_are_planned(lower, simulator):
    pytest.importorskip(simulator)
    settled = scenegen.settle(scenes_of(lower, 3), simulator, seconds=1.0, workers=1)
    worst = settled.shift[:, 1::2].max(axis=0)
    assert settled.deepest.max() < 1e-3
    assert worst.max() < 2e-3, dict(zip(carried(lower), worst, strict=True))
    assert settled.turn.max() < 2.0


def test_vessels_take_what_is_narrower_where_they_are_narrow():
    assert "bowl" in carried("plate") and "plate" in carried("plate") and "bowl" in carried("bowl")
    for lower in ("plate", "bowl", "pot", "basket"):
        assert len(carried(lower)) > 10, lower


def test_equal_plates_touch_with_their_feet_and_equal_bowls_with_their_walls():
    plate, bowl = shape_of("plate"), shape_of("bowl")
    assert nested(plate, plate).height == 0.007
    # a bowl's knee (61 mm wide, 21 mm high) meets the wall between its knee (52 mm at 21 mm) and rim (76 mm at 60 mm)
    meets = 0.021 + 0.039 * (0.061 - 0.052) / 0.024
    assert 0.0 <= nested(bowl, bowl).height - (meets - 0.021) < 0.0015


def test_what_would_roll_or_tilt_on_a_wall_is_refused():
    for upper in ("pen", "marker", "mouse"):
        assert nested(shape_of("bowl"), shape_of(upper)) is None
    for upper in ("lemon", "block"):
        assert nested(shape_of("bowl"), shape_of(upper)) is not None


def test_handles_that_would_lie_on_a_wall_are_refused():
    assert nested(shape_of("bowl"), shape_of("mug")) is None
    assert nested(shape_of("cup"), shape_of("cup")) is None
    assert nested(shape_of("mug"), shape_of("mug")).name == "rim"
