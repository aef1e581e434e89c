"""Layout pools for Isaac Lab-Arena: what its reader asks of a file, restated as facts."""

import json
import math

import pytest

import scenegen
from scenegen.errors import RequestError
from scenegen.layouts import write_arena_pool

SPEC = scenegen.parse("""
object mug = cylinder(4 cm, 10 cm), box = box(20 cm, 10 cm, 5 cm)
require noOverlap()
task: closeTo(mug, box, 30 cm)
""")
KEYS = {"placement_seed", "num_envs", "uses_env_specific_bboxes", "had_fallbacks", "env_pools"}
LAYOUT = {"positions", "orientations", "validation", "final_loss", "attempts"}


def whole(value):
    return isinstance(value, int) and not isinstance(value, bool)


def finite(value):
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def read(path, objects):
    """The pools of a file, by the rules of the reader: every object has a place in every layout and no other has one,
    yaws are for objects that have a place, checks are named and true or false, no environment is without a layout."""
    document = json.loads(path.read_text(), parse_constant=lambda word: pytest.fail(word))
    assert set(document) >= KEYS
    assert whole(document["num_envs"]) and document["num_envs"] == len(document["env_pools"])
    assert document["placement_seed"] is None or whole(document["placement_seed"])
    assert isinstance(document["uses_env_specific_bboxes"], bool) and document["had_fallbacks"] is False
    for pool in document["env_pools"]:
        assert pool
        for layout in pool:
            assert set(layout) >= LAYOUT
            assert set(layout["positions"]) == set(objects) >= set(layout["orientations"])
            assert all(len(place) == 3 and all(map(finite, place)) for place in layout["positions"].values())
            assert all(map(finite, layout["orientations"].values()))
            assert layout["validation"] and all(check is True for check in layout["validation"].values())
            assert finite(layout["final_loss"]) and whole(layout["attempts"])
    return document["env_pools"]


def test_a_pool_is_as_its_reader_wants_it(tmp_path):
    scenes = scenegen.sample(SPEC, (0.0, None), n=7)
    path = write_arena_pool(
        scenes, tmp_path / "pool.json", num_envs=3, names={"mug": "coffee_mug"}, anchors={"table": (0.5, 0, 0.1)},
        origin=(0.5, 0.0, 0.4), origins="middle", seed=4,
    )  # fmt: skip
    pools = read(path, {"coffee_mug", "box", "table"})
    assert [len(pool) for pool in pools] == [3, 2, 2]
    for index, pose in enumerate(scenes.poses):
        layout = pools[index % 3][index // 3]
        assert layout["positions"]["coffee_mug"] == pytest.approx([pose[0, 0] + 0.5, pose[0, 1], 0.45])
        assert math.cos(layout["orientations"]["box"] - pose[1, 2]) == pytest.approx(1.0)
        assert layout["positions"]["table"] == [0.5, 0, 0.1] and layout["orientations"]["table"] == 0.0
        mug, box = (layout["positions"][name] for name in ("coffee_mug", "box"))
        assert math.dist(mug[:2], box[:2]) <= 0.3


def test_bad_requests_are_answered_and_write_nothing(tmp_path):
    scenes = scenegen.sample(SPEC, n=2)
    cases = [
        ("too-few-layouts", {"num_envs": 3}),
        ("out-of-range", {"num_envs": 0}),
        ("unknown-choice", {"names": {"cup": "mug"}}),
        ("name-twice", {"anchors": {"mug": (0, 0, 0)}}),
        ("wrong-value", {"anchors": {"table": (0, 0)}}),
        ("wrong-value", {"anchors": {"table": (0, 0, math.nan)}}),
        ("wrong-value", {"seed": 0.5}),
    ]
    for code, settings in cases:
        with pytest.raises(RequestError) as error:
            write_arena_pool(scenes, tmp_path / "pool.json", **settings)
        assert error.value.diagnostics[0].code == code
    assert not list(tmp_path.iterdir())


def test_scenes_beside_the_range_that_was_asked_for_are_not_called_verified(tmp_path):
    spec = scenegen.parse("object red, blue\ntask: dist(red, blue) <= 0")
    scenes = scenegen.sample(spec, (0, None), n=4)  # warns, and draws beside the bound
    with pytest.raises(RequestError, match="only-at-bound"):
        write_arena_pool(scenes, tmp_path / "pool.json")
    assert not (tmp_path / "pool.json").exists()
