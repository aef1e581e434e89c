"""What is measured at a start, by hand; and the fingerprint of what it follows from."""

import numpy as np
import pytest

import scenegen
from scenegen.api.scene_arrays import rows_of
from scenegen.learn.success.features import fingerprint, measure_features, things_of

from .conftest import OWN, TASK


def of(text, label, poses):
    """The features of one scene by name."""
    spec = scenegen.parse(text)
    scenes = spec.scenes({name: (*pose, 0.0)[:3] for name, pose in poses.items()})
    features, values = measure_features(spec.checked, label, rows_of(spec.checked, scenes))
    return dict(zip((one.name for one in features), values[:, 0].tolist(), strict=True)), features


def test_by_hand():
    found, features = of(OWN, "goal", {"cube": (0.5, 0.4), "can": (0.2, 0.4), "crate": (0.5, 0.8)})
    half = scenegen.parse(OWN).checked.shapes[1].footprint.radius
    assert features[0].kind == "phi" and found["phi of goal"] == pytest.approx(-0.3)
    margins = [value for name, value in found.items() if name.startswith("margin")]
    assert sorted(margins) == pytest.approx([-0.3, -0.18])
    assert found["room around cube"] == pytest.approx(0.3 - 0.025 - half)
    assert found["room around can"] == found["room around cube"] == found["least room"]
    assert found["things within 0.1 m"] == 0.0
    assert found["distance of cube and can"] == pytest.approx(0.3)
    assert (found["x of can"], found["y of can"]) == (0.2, 0.4) and "x of crate" not in found
    assert found["distance of cube from the middle"] == pytest.approx(0.1)
    assert found["cos of the heading of cube"] == 1.0


def test_margins_of_one_place_count_as_one():
    text = "object block[4], mug\ntask: noOverlap() & leftOf(block[1], mug) & leftOf(block[2], mug)"
    places = {f"block[{k}]": (0.2 * k, 0.2) for k in range(1, 5)} | {"mug": (0.5, 0.8)}
    _, features = of(text, "task", places)
    margins = [one.name for one in features if one.kind == "margin"]
    assert len(margins) == 3 and sum("the least of 10" in one for one in margins) == 1
    assert len({one.name for one in features}) == len(features)


def test_margins_that_read_alike_have_names_of_their_own():
    _, features = of("object mug, plate\ntask: x(mug) >= 0.2 | (x(mug) >= 0.2 & leftOf(mug, plate))", "task", PLACES)
    assert len({one.name for one in features}) == len(features)


PLACES = {"mug": (0.3, 0.3), "plate": (0.7, 0.7)}


def test_what_stands_still_is_no_place():
    found, _ = of("object mug, plate at (0.7, 0.7)\ntask: leftOf(mug, plate)", "task", PLACES)
    assert "x of mug" in found and "x of plate" not in found and found["distance of mug and plate"] > 0.5


def test_the_objects_of_the_success_formula():
    spec = scenegen.parse(OWN).checked
    assert [spec.objects[one] for one in things_of(spec, "goal")] == ["cube", "can"]


@pytest.mark.parametrize(
    "text, same",
    [
        (TASK, True),
        ("# words\n" + OWN.replace("leftOf(cube, can)", "leftOf(cube,  can)"), True),
        ("object cube = box(5 cm, 4 cm, 4 cm), can, crate = box(20 cm, 20 cm, 10 cm)\n" + OWN.splitlines()[2], True),
        (OWN.replace("box(5 cm", "box(6 cm"), False),
        (OWN.replace("12 cm", "13 cm"), False),
        (OWN.replace("leftOf(cube, can)", "leftOf(can, cube)"), False),
        (OWN.replace("leftOf", "rightOf"), False),
        ("workspace [0, 2] x [0, 1]\n" + OWN, False),
        (OWN.replace("can, crate", "can at (0.5, 0.5), crate"), False),
    ],
)
def test_the_fingerprint_is_of_objects_and_success_alone(text, same):
    mine, other = (fingerprint(scenegen.parse(one).checked, "goal") for one in (OWN, text))
    assert (mine == other) is same
    assert fingerprint(scenegen.parse(OWN).checked, "near") != mine


def test_the_fingerprint_is_the_same_everywhere():
    known = "e200c892fc60edbb10785cc5dd4ce4f1a9d25668f35cdc71a8ce3ce9ad75cb6f"
    assert fingerprint(scenegen.parse(OWN).checked, "goal") == known


def test_values_do_not_depend_on_the_company():
    spec = scenegen.parse(OWN)
    scenes = scenegen.sample(spec, n=50, seed=1)
    rows = rows_of(spec.checked, scenes)
    _, whole = measure_features(spec.checked, "goal", rows)
    _, one = measure_features(spec.checked, "goal", rows[:, 7:8])
    assert np.allclose(whole[:, 7:8], one, rtol=0.0, atol=1e-14)


@pytest.mark.long
@pytest.mark.parametrize("name", ["first", "chess_corner", "cutlery_tray", "recycling", "sort_7"])
def test_specs_that_ship_have_features(name, root):
    spec = scenegen.load(root / "specs" / f"{name}.spec")
    rows = rows_of(spec.checked, scenegen.sample(spec, n=8))
    features, values = measure_features(spec.checked, spec.labels[0], rows)
    assert np.isfinite(values).all() and values.shape == (len(features), 8)
    assert len({one.name for one in features}) == len(features) and features[0].kind == "phi"
