"""Files for Isaac Lab-Arena, held against what its readers ask of them, written anew from what they do (August 2026).
Arena itself needs Isaac Sim, and was not run."""

import json
import math

import numpy as np
import pytest

import scenegen
from scenegen.errors import DataError, RequestError
from scenegen.layouts import write_arena_episodes, write_arena_pool

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
        ("same-name", {"anchors": {"mug": (0, 0, 0)}}),
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


# --------------------------------------------------------------------------------------------------------------------
# Episodes that are replayed.


def no_key_twice(pairs):
    found = dict(pairs)
    assert len(found) == len(pairs)
    return found


def replayed(path, roots, required):
    """The placements of a file by the rules of all its readers: a JSON object a line, in a file named .jsonl; the
    placement stands in one of two places, in every line; the same roots in all, each known to the scene, with all that
    have to be placed; three numbers and a unit quaternion; and no layout has the name of another."""
    assert path.suffix.lower() == ".jsonl"
    found, others = [], []
    for line in filter(str.strip, path.read_text(encoding="utf-8").splitlines()):
        record = json.loads(line, object_pairs_hook=no_key_twice, parse_constant=lambda word: pytest.fail(word))
        assert isinstance(record, dict) and isinstance(record.get("variations", {}), dict)
        old, new = record.get("variations", {}).pop("scene.relation_placement", None), record.get("placement")
        assert (old is None) != (new is None)
        found.append(old or new)
        others.append({**record.pop("variations"), "rest": record})
    assert found and all(isinstance(one, dict) for one in found)
    for one in found:
        assert all(isinstance(one[key], str) and one[key] for key in ("layout_id", "source"))
        assert one["poses"].keys() == found[0]["poses"].keys() and required <= one["poses"].keys() <= roots
        for pose in one["poses"].values():
            assert pose.keys() == {"position_xyz", "rotation_xyzw"}
            place, turn = pose["position_xyz"], pose["rotation_xyzw"]
            assert isinstance(place, list) and len(place) == 3 and isinstance(turn, list) and len(turn) == 4
            assert all(map(finite, [*place, *turn]))
            assert math.isclose(sum(part * part for part in turn), 1.0, abs_tol=1e-4)
        assert "assets" not in one or one["assets"].keys() == one["poses"].keys()
    assert len({one["layout_id"] for one in found}) == len(found)
    assert not any(other.keys() - {"rest"} for other in others)  # no variations that have to be enabled
    return found, [other["rest"] for other in others]


def test_episodes_are_as_their_reader_wants_them(tmp_path):
    scenes = scenegen.sample(SPEC, (-0.1, 0.1), n=7, seed=2)
    path = write_arena_episodes(
        scenes, tmp_path / "starts.jsonl", names={"mug": "coffee_mug"}, origin=(0.5, 0.0, 0.4), turn=0.5,
        origins="middle",
    )  # fmt: skip
    found, rest = replayed(path, {"coffee_mug", "box", "table", "robot"}, {"coffee_mug", "box"})
    assert len(found) == 7
    cosine, sine = math.cos(0.5), math.sin(0.5)
    for one, record, poses, phi in zip(found, rest, scenes.poses, scenes.phi["task"], strict=True):
        x, y, theta = poses[1]
        box = one["poses"]["box"]
        assert box["position_xyz"] == pytest.approx([cosine * x - sine * y + 0.5, sine * x + cosine * y, 0.425])
        half = (theta + 0.5) / 2
        upright = np.array([0, 0, math.sin(half), math.cos(half)])
        assert abs(np.dot(box["rotation_xyzw"], upright)) == pytest.approx(1.0)
        assert record["phi"] == {"task": phi} and -0.1 <= phi <= 0.1
        mug = one["poses"]["coffee_mug"]["position_xyz"]
        assert 0.3 - math.dist(mug[:2], box["position_xyz"][:2]) == pytest.approx(phi)


def test_what_arena_has_as_an_anchor_is_left_out_and_bodies_stand_by_their_own_axis(tmp_path):
    scenes = scenegen.sample(SPEC, n=2)
    path = write_arena_episodes(scenes, tmp_path / "starts.jsonl", names={"box": None}, up={"mug": "y"})
    found, _ = replayed(path, {"mug", "box"}, {"mug"})
    for one in found:
        x, y, z, w = one["poses"]["mug"]["rotation_xyzw"]
        assert 2 * (y * z + w * x) == pytest.approx(1.0)  # the body's y axis points up


def test_bad_requests_for_episodes_are_answered_and_write_nothing(tmp_path):
    scenes = scenegen.sample(SPEC, n=2)
    cases = [
        ("wrong-value", "starts.json", {}),
        ("wrong-value", "starts.jsonl", {"names": {"mug": 3}}),
        ("wrong-value", "starts.jsonl", {"names": {"mug": None, "box": None}}),
        ("unknown-choice", "starts.jsonl", {"names": {"cup": "mug"}}),
        ("same-name", "starts.jsonl", {"names": {"mug": "box"}}),
        ("unknown-choice", "starts.jsonl", {"up": {"mug": "w"}}),
    ]
    for code, name, settings in cases:
        with pytest.raises(RequestError) as error:
            write_arena_episodes(scenes, tmp_path / name, **settings)
        assert error.value.diagnostics[0].code == code
    with pytest.raises(DataError, match="no-scenes"):
        write_arena_episodes(scenes[:0], tmp_path / "starts.jsonl")
    with pytest.raises(RequestError, match="wrong-value"):
        write_arena_pool(scenes, tmp_path / "pool.json", names={"mug": None})
    drawn = scenegen.parse("object block[1..2], mug\ntask: leftOf(block[1], mug)")
    with pytest.raises(DataError):
        write_arena_episodes(scenegen.sample(drawn, n=4), tmp_path / "starts.jsonl")
    assert not list(tmp_path.iterdir())
