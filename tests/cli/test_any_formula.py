"""A formula that nobody tested, from text to verified scenes in one command."""

import json
import math

FORMULA = "(leftOf(fork, plate) | aboveOf(fork, plate)) & !closeTo(fork, plate, 0.15) & closeTo(spoon, fork, 0.3)"


def phi_by_hand(poses):
    """The paper's Definition 2, written out; shares nothing with the package."""
    fork, plate, spoon = (poses[name] for name in ("fork", "plate", "spoon"))
    left_or_above = max(plate["x"] - fork["x"], fork["y"] - plate["y"])
    apart = math.sqrt((fork["x"] - plate["x"]) ** 2 + (fork["y"] - plate["y"]) ** 2) - 0.15
    together = 0.3 - math.sqrt((spoon["x"] - fork["x"]) ** 2 + (spoon["y"] - fork["y"]) ** 2)
    return min(left_or_above, apart, together)


def test_from_text_to_a_hundred_scenes(scenegen, here):
    (here / "mine.spec").write_text(FORMULA)
    outcome = scenegen("sample", "mine.spec", "--phi", "0.05:0.2", "-n", "100", "--out", "s.json")
    assert outcome.status == 0, outcome.err
    data = json.loads((here / "s.json").read_text())
    assert len(data["scenes"]) == 100
    values = [phi_by_hand(scene["poses"]) for scene in data["scenes"]]
    assert all(0.05 - 1e-12 <= value <= 0.2 + 1e-12 for value in values)
    for value, scene in zip(values, data["scenes"], strict=True):
        assert abs(value - scene["phi"]["task"]) <= 1e-12
        for pose in scene["poses"].values():
            assert 0 <= pose["x"] <= 1 and 0 <= pose["y"] <= 1 and 0 <= pose["theta"] < 2 * math.pi
    assert len({json.dumps(scene["poses"]) for scene in data["scenes"]}) == 100
    assert scenegen("eval", "mine.spec", "s.json").status == 0
