"""`cabinet(drawers, open)`: shapes, surfaces, files, and drawers that are not open enough."""

import json

import pytest

import scenegen
from scenegen.errors import SpecError
from scenegen.lang.checker import check_text


def spec(shape, what="spoon", drawer=2):
    return f"object c = {shape} at (0.5, 0.5, SOUTH), {what} on c.drawer[{drawer}]\ntask: leftOf({what}, c)"


def problem(text):
    with pytest.raises(SpecError) as caught:
        check_text(text)
    (found,) = caught.value.diagnostics
    return found


@pytest.mark.parametrize(
    ("written", "open"),
    [
        ("cabinet", ()),
        ("cabinet()", (0.0, 0.0, 0.0)),
        ("cabinet(open = 0.6)", (0.0, 0.0, 0.6)),
        ("cabinet(2)", (0.0, 0.0)),
        ("cabinet(2, 0.5)", (0.0, 0.5)),
        ("cabinet(open = [1, 0.25])", (1.0, 0.25)),
        ("cabinet(drawers = 1, open = [0.5])", (0.5,)),
    ],
)
def test_how_many_drawers_and_how_far_each_is_open(written, open):
    found = check_text(f"object c = {written}, mug on c.top\ntask: leftOf(mug, c)")
    assert found.shapes[0].open == open
    assert found.heights[1] == pytest.approx(found.shapes[0].height)
    assert check_text(found.source).shapes == found.shapes


@pytest.mark.parametrize(
    ("written", "code"),
    [
        ("cabinet(drawers = 0)", "wrong-drawers"),
        ("cabinet(drawers = 7)", "wrong-drawers"),
        ("cabinet(open = 60)", "wrong-drawers"),
        ("cabinet(open = [0, -0.1])", "wrong-drawers"),
        ("cabinet(drawers = 3, open = [0, 0.5])", "wrong-drawers"),
        ("cabinet(open = [])", "wrong-drawers"),
        ("cabinet(open = 6 cm)", "wrong-unit"),
        ("cabinet(drawers = 2.5)", "not-a-whole-number"),
        ('mesh("a.obj", cabinet())', "not-a-shape"),
    ],
)
def test_what_a_cabinet_cannot_be(written, code):
    assert problem(f"object c = {written}, mug\ntask: leftOf(mug, c)").code == code


@pytest.mark.parametrize(
    ("shape", "what", "facts"),
    [
        ("cabinet()", "spoon", {"share": 0.0, "reach": 0.0, "need": 3.8, "least": 0.27, "mended": "[0, 0.27, 0]"}),
        ("cabinet(open = [0, 0.3, 0])", "mug", {"reach": 5.0, "need": 12.4, "least": 0.55, "mended": "[0, 0.55, 0]"}),
        ("cabinet(open = [0, 0.5, 0.3])", "spoon", {"reach": 2.0, "least": 0.57, "mended": "[0, 0.57, 0.3]"}),
        ("cabinet(open = [0, 0.5, 0.9])", "spoon", {"reach": 0.0, "least": 0.27, "mended": "[0, 0.5, 0]"}),
    ],
)
def test_a_drawer_that_is_not_open_enough_says_which_range_is(shape, what, facts):
    """The range is right: its end is accepted, and a little more than a hundredth less is not."""
    found = problem(spec(shape, what))
    assert found.code == "drawer-not-open" and found.span is not None
    wanted = dict(facts)
    mended = f"cabinet(open = {wanted.pop('mended')})"
    assert {key: found.facts[key] for key in wanted} == pytest.approx(wanted) and found.facts["mended"] == mended
    assert check_text(spec(mended, what)).heights[1] == pytest.approx(0.148)
    if f"{facts['least']:g}" in mended:
        less = mended.replace(f"{facts['least']:g}", f"{facts['least'] - 0.0101:g}")
        assert problem(spec(less, what)).code == "drawer-not-open"


def test_what_fits_into_no_drawer_is_said_to_be_too_large():
    assert problem(spec("cabinet(open = [0, 0.5, 0])", "tray")).code == "does-not-fit"
    assert problem("object c = cabinet(), mug on c.drawer[4]\ntask: leftOf(mug, c)").code == "index-out-of-range"


def test_what_is_in_a_drawer_is_known_to_be_clear_of_the_cabinet():
    """The walls of the drawer cost nothing: no piece of the cabinet is left in the requirement."""
    text = spec("cabinet(open = [0, 0.9, 0])").replace("task:", "require noCollision()\ntask:")
    required = [node.text for node in check_text(text).core.nodes if hasattr(node, "text") and "gap" in node.text]
    assert required == []


def test_a_lid_closes_a_pot_and_can_lie_beside_it():
    found = check_text(
        "object pot, lid on pot.rim, orange on pot.inside\nrequire noCollision()\ntask: dist(pot, lid) <= 1"
    )
    assert found.heights == pytest.approx((0.0, 0.110, 0.008))
    with pytest.raises(SpecError, match="does not fit"):
        check_text("object pot, lid on pot\ntask: dist(pot, lid) <= 1")


def test_heights_that_rule_a_requirement_out_are_said():
    text = "object bowl, orange on bowl\nrequire atLevel(orange, bowl)\ntask: leftOf(bowl, (1, 1))"
    assert problem(text).code == "impossible-requirement"
    text = "object tray, can on tray, mug\nrequire noCollision() & restsOn(mug, tray)\ntask: leftOf(mug, tray)"
    assert problem(text).code == "impossible-requirement"


def test_scene_files_say_how_far_drawers_are_open(tmp_path):
    scenes = scenegen.sample(scenegen.parse(spec("cabinet(open = [0, 0.9, 0])")), {"task": (0.0, None)}, n=2)
    path = scenes.save(tmp_path / "scenes.json")
    shapes = {one["name"]: one["shape"] for one in json.loads(path.read_text())["objects"]}
    assert shapes["c"]["open"] == [0.0, 0.9, 0.0] and "open" not in shapes["spoon"]
    assert scenegen.read_scenes(path).header.objects[0].shape.open == [0.0, 0.9, 0.0]
