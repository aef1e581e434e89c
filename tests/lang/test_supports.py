"""What `object a on b` means: heights, boxes, requirements; and bodies that share no space, against another oracle.
`cabinet(drawers, open)`: shapes, surfaces, files, and drawers that are not open enough. `on any of [...]` and
regions at heights, in the language. `base`, `load` and what the prelude says with them, where supports are choices:
in each scene they are those of the spec with the surfaces that the scene has.
"""

import json
import math
from itertools import product

import numpy as np
import pytest

import scenegen
from scenegen.errors import Source, SpecError
from scenegen.geometry import NUMPY, Box, Circle, Polygon
from scenegen.geometry.footprint import standing_area
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom, gate, part_of
from scenegen.lang.formula.interpret import phi
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.lang.spec import chosen_options
from scenegen.lang.syntax.printer import format_source
from scenegen.pose import X, row_of
from scenegen.search import spec_bounds

TOWER = """object tray, can on tray, low = box(0.2, 0.2, 0.05), block[3] on [low, block[1], block[2]]
require noCollision()
task: leftOf(can, low)
"""


def test_heights_follow_the_chain_of_supports():
    spec = check_text(TOWER)
    assert dict(zip(spec.objects, spec.heights, strict=True)) == pytest.approx(
        {"tray": 0.0, "can": 0.01, "low": 0.0, "block[1]": 0.05, "block[2]": 0.10, "block[3]": 0.15}
    )
    assert [spec.supports[which].name for which in sorted(spec.supports)] == [
        "tray.inside",
        "low.top",
        "block[1].top",
        "block[2].top",
    ]


def test_a_spec_without_supports_is_what_it_was():
    spec = check_text("object mug, plate\nrequire noOverlap()\ntask: leftOf(mug, plate)")
    assert (spec.supports, spec.heights, spec.workspace.own) == ({}, (), ())


def test_the_canonical_text_means_the_same_and_formatting_keeps_it():
    spec = check_text(TOWER)
    again = check_text(spec.source)
    assert (again.core.labels, again.supports, again.heights) == (spec.core.labels, spec.supports, spec.heights)
    assert format_source(Source("spec", TOWER)).splitlines()[0].endswith("block[3] on [low, block[1], block[2]]")


def test_on_is_a_name_where_it_opens_no_clause():
    assert check_text("object on on tray, tray\ntask: on(on, tray)").objects == ("on", "tray")
    assert check_text("object mug, cup\non: leftOf(mug, cup)").labels == ("on",)
    assert check_text("on(mug, plate)").objects == ("mug", "plate")


def test_what_carries_stays_uniform_and_what_it_carries_is_uniform_on_it():
    """The box of what is carried is padded: the place of the tray does not depend on what stands on it."""
    spec = scenegen.parse("object tray, can on tray.inside, mug\ntask: leftOf(can, mug) | leftOf(mug, can)")
    scenes = scenegen.sample(spec, {"task": (0.0, None)}, n=2000, spread="base", seed=4)
    tray, can = scenes.poses[:, 0], scenes.poses[:, 1]
    for axis in (0, 1):
        shares = np.histogram(tray[:, axis], bins=10, range=(0.0, 1.0))[0] / 2000
        assert np.abs(shares - 0.1).max() < 0.035  # five standard deviations
    cos, sin = np.cos(tray[:, 2]), np.sin(tray[:, 2])
    dx, dy = can[:, 0] - tray[:, 0], can[:, 1] - tray[:, 1]
    u, v = cos * dx + sin * dy, cos * dy - sin * dx
    for place, half in ((u, 0.378 / 2 - 0.033), (v, 0.278 / 2 - 0.033)):
        assert np.abs(place).max() <= half + 1e-9
        shares = np.histogram(place, bins=5, range=(-half, half))[0] / 2000
        assert np.abs(shares - 0.2).max() < 0.045


def test_an_object_on_a_region_is_uniform_over_it():
    spec = check_text("object mug on mat, cup\nregion mat = rect(0.2, 0.1, 0.6, 0.3)\ntask: leftOf(mug, cup)")
    low, high = spec.box()
    assert (low[:2].tolist(), high[:2].tolist()) == ([0.2, 0.1], [0.6, 0.3])
    assert spec.core.requirement is None


def corners(low, high, footprint, pose):
    """The corners of an upright prism, as a box of halves and a turn."""
    return (footprint.length / 2, footprint.width / 2, (high - low) / 2), (*pose[:2], (low + high) / 2), pose[2]


def separated(one, other):
    """The signed separation of two upright boxes along the axes that can part them: another way to the same number."""
    (a, b, c), (x, y, z), turn = one
    (d, e, f), (u, v, w), spin = other
    best = abs(z - w) - c - f
    for angle in (turn, turn + np.pi / 2, spin, spin + np.pi / 2):
        n = np.array([np.cos(angle), np.sin(angle)])
        reach = 0.0
        for (long, wide), own in (((a, b), turn), ((d, e), spin)):
            reach += long * abs(n @ [np.cos(own), np.sin(own)]) + wide * abs(n @ [-np.sin(own), np.cos(own)])
        best = max(best, abs(n @ [u - x, v - y]) - reach)
    return best


def test_boxes_collide_where_no_axis_parts_them():
    text = """object low = box(0.3, 0.2, 0.05), middle = box(0.2, 0.1, 0.08) on low, other = box(0.1, 0.3, 0.12)
task: noCollision()
"""
    spec = scenegen.parse(text)
    rng = np.random.default_rng(3)
    poses = rng.uniform(0.0, 1.0, (500, 3, 3)) * (0.4, 0.4, 6.28)
    phi = [evaluate(spec.checked.core, scene.ravel())["task"] for scene in poses]
    for scene, value in zip(poses, phi, strict=True):
        bodies = [
            corners(z, z + shape.height, shape.footprint, pose)
            for z, shape, pose in zip(spec.checked.heights, spec.checked.shapes, scene, strict=True)
        ]
        wanted = min(separated(bodies[a], bodies[b]) for a, b in ((0, 1), (0, 2), (1, 2)))
        if wanted <= 0.0:  # apart, the way to the nearest corner is longer than along an axis
            assert value == pytest.approx(wanted, abs=1e-9)
        else:
            assert value >= wanted - 1e-9


def test_surfaces_of_a_stretched_or_unknown_thing():
    with pytest.raises(SpecError, match="things can stand on"):
        check_text("object shelfunit, book on shelfunit.lid\ntask: leftOf(book, shelfunit)")
    with pytest.raises(SpecError, match="a declaration cannot measure objects"):
        check_text("object mug, cup at (z(mug), 0.5)\ntask: leftOf(mug, cup)")


@pytest.mark.long
def test_what_is_required_is_as_deep_as_the_text():
    """Neither depth nor sharing costs more than the number of parts: a formula of 5,000 levels is checked."""
    deep = "leftOf(can, mug) & (leftOf(mug, can) | (" * 2500 + "farFrom(can, mug)" + "))" * 2500
    spec = check_text(f"object tray, can on tray, mug\nrequire {deep}\ntask: leftOf(can, mug)")
    assert spec.core.requirement is not None


def test_what_is_required_has_no_constants_and_no_pairs_that_heights_keep_apart():
    spec = check_text(TOWER)
    texts = [node.text for node in spec.core.nodes if isinstance(node, Atom)]
    assert "gap(tray, low) >= 0" in texts and "gap(can, low) >= 0" in texts
    assert not any("max(" in text or "gap(block[1], block[2])" in text for text in texts)


@pytest.mark.parametrize(
    ("part", "metres"),
    [
        ("tray.inside.length", 0.378),
        ("tray.inside.width", 0.278),
        ("tray.inside.depth", 0.035),
        ("tray.inside.height", 0.035),
        ("shelfunit.shelf[1].depth", 0.204),
        ("book.top.length", 0.21),
        ("glass.inside.width", 0.051),
    ],
)
def test_sizes_of_surfaces(part, metres):
    """They are those of the library's objects, constants that the heading does not change."""
    spec = check_text(f"object tray, shelfunit, book, glass, mug\ntask: x(mug) <= {part}\n")
    ((low, high),) = spec_bounds(spec).values()
    assert high == pytest.approx(metres, abs=1e-4) and low == pytest.approx(metres - 1.0, abs=1e-4)


@pytest.mark.parametrize("part", ["book.top.depth", "tray.inside.left", "tray.width", "base(mug).width"])
def test_sizes_that_there_are_not(part):
    with pytest.raises(SpecError) as caught:
        check_text(f"object tray, book, mug on any of [tray, workspace]\ntask: x(mug) <= {part}\n")
    assert caught.value.diagnostics[0].code == "no-such-part"


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


TEXT = """region shelf[2] = rect(0.1, 0.6, 0.9, 0.95) at 30 cm, 60 cm
object book[2] on any of shelf, tray on any of [shelf[1], workspace] by area, can on tray
task: z(can) >= 20 cm & restsOn(book[1], shelf[2])
"""


def test_switches_come_after_the_objects_and_stay_out_of_sight():
    spec = check_text(TEXT)
    assert spec.objects == ("book[1]", "book[2]", "tray", "can")
    assert spec.core.objects[4:] == ("book[1].on", "book[2].on", "tray.on")
    assert spec.heights == (None, None, None, None) and set(spec.choices) == {0, 1, 2}
    assert spec.choices[0].ends == (0.5, 1.0)  # the same area
    assert [region.height for region in spec.regions] == [0.3, 0.6]


def test_equal_shares_take_more_of_the_switch_for_smaller_surfaces():
    text = "region small = rect(0, 0, 0.1, 0.1)\nobject can on any of [small, workspace]{}\ntask: x(can) <= 0.5"
    equal, area = (check_text(text.format(words)).choices[0].ends for words in ("", " by area"))
    assert equal == pytest.approx((100.0 / 101.0, 1.0)) and area == (0.5, 1.0)


def test_the_canonical_text_means_the_same_and_formatting_keeps_it_choices():
    spec = check_text(TEXT)
    again = check_text(spec.source)
    assert (again.core, again.choices, again.heights) == (spec.core, spec.choices, spec.heights)
    assert format_source(Source("spec", TEXT)) == TEXT
    wide = "region  shelf[ 2 ]=rect(0,0,1,1)  at 30 cm ,60 cm # two\nobject a on any   of[shelf[1],workspace]by  area\n"
    assert format_source(Source("spec", wide + "task: x(a) <= 0.5")).splitlines()[:2] == [
        "region shelf[2] = rect(0, 0, 1, 1) at 30 cm, 60 cm  # two",
        "object a on any of [shelf[1], workspace] by area",
    ]


def test_the_words_of_choices_are_names_elsewhere():
    text = "object any, of, by, area on any\ntask: leftOf(any, of) & leftOf(by, area)"
    assert check_text(text).objects == ("any", "of", "by", "area")


def test_a_choice_of_one_is_a_support():
    spec = check_text("object tray, can on any of [tray], mug\ntask: leftOf(can, mug)")
    assert (spec.choices, spec.supports[1].name) == ({}, "tray.inside")


@pytest.mark.parametrize(
    ("upper", "outline", "area"),
    [
        (Circle(0.0), Circle(0.2), math.pi * 0.04),
        (Circle(0.05), Circle(0.2), math.pi * 0.0225),
        (Circle(0.05), Box(0.4, 0.2), 0.3 * 0.1),
        (Circle(0.05), Polygon(((0, 0), (0.4, 0), (0.4, 0.2), (0, 0.2))), 0.3 * 0.1),
        (Box(0.5, 0.01), Box(0.4, 0.2), 0.0),
        (Circle(0.0), Polygon(((0, 0), (1, 0), (0, 1))), 0.5),
    ],
)
def test_the_area_on_which_a_footprint_can_stand(upper, outline, area):
    assert standing_area(upper, outline) == pytest.approx(area, abs=1e-12)


@pytest.mark.parametrize("outline", [Box(0.4, 0.25), Circle(0.17)])
def test_the_area_is_that_of_random_places(outline):
    upper, rng = Box(0.2, 0.1), np.random.default_rng(0)
    x, y, turn = rng.uniform(-0.2, 0.2, 40_000), rng.uniform(-0.2, 0.2, 40_000), rng.uniform(0, math.tau, 40_000)
    inside = np.ones(40_000, dtype=bool)
    for u, v in ((0.1, 0.05), (0.1, -0.05), (-0.1, 0.05), (-0.1, -0.05)):
        px, py = x + np.cos(turn) * u - np.sin(turn) * v, y + np.sin(turn) * u + np.cos(turn) * v
        if isinstance(outline, Circle):
            inside &= np.hypot(px, py) <= outline.radius
        else:
            inside &= (np.abs(px) <= outline.length / 2) & (np.abs(py) <= outline.width / 2)
    assert standing_area(upper, outline) == pytest.approx(0.16 * inside.mean(), abs=5 * 0.16 * 0.5 / 200)


def test_names_of_heights_can_be_defined_by_a_spec():
    text = """object tray, can on tray, mug
    def z(a) = y(a)
    def stable(a, b) = leftOf(a, b)
    def restsOn(a) = z(a) >= 0.2
    task: stable(can, mug) & restsOn(can)
    mine: stackedOn(can, tray)
    """
    plain = check_text("object tray, can on tray, mug\nmine: stackedOn(can, tray)")
    mine = [
        [node.text for node in part_of(one.core, ["mine"]).nodes if isinstance(node, Atom)]
        for one in (check_text(text), plain)
    ]
    assert mine[0] == mine[1] and "y(can)" not in str(mine)  # the prelude goes on with its own z
    assert check_text(text).core.objects == plain.core.objects


CARRIERS = {"book": ("shelf[1]", "tray", "workspace"), "mug": ("tray", "shelf[2]"), "can": ("book", "workspace")}
CASES = """region shelf[2] = rect(0.1, 0.6, 0.9, 0.95) at 30 cm, 60 cm
object tray, {}, shelfunit at (0.25, 0.25, SOUTH)
require noCollision()
free: noCollision()
rests: restsOn(can, book) | insideOf(mug, tray) | underneath(book, shelfunit)
high: z(can) + top(mug) + x(can) <= 60 cm
"""


@pytest.mark.long
def test_phi_and_requirement_are_those_of_the_spec_with_the_surfaces_chosen():
    """Of every combination: hollow and solid bodies, furniture, boards, and what stands on what chooses."""
    choice = check_text(CASES.format(", ".join(f"{n} on any of [{', '.join(s)}]" for n, s in CARRIERS.items())))
    assert choice.objects == ("tray", "book", "mug", "can", "shelfunit")
    rng, count, met = np.random.default_rng(0), 2000, 0
    rows = np.zeros((3 * len(choice.core.objects), count))
    rows[:15] = rng.uniform(0.3, 0.9, (15, count))
    rows[12:15] = np.array(choice.fixed[4])[:, None]
    for on in product(*map(enumerate, CARRIERS.values())):
        plain = check_text(CASES.format(", ".join(f"{n} on {s}" for n, (_, s) in zip(CARRIERS, on, strict=True))))
        for one, (which, _) in zip(choice.choices.values(), on, strict=True):
            rows[3 * one.switch] = one.middles[which]
        mine, wanted = (phi(gate(one.core), list(some), NUMPY) for one, some in ((choice, rows), (plain, rows[:15])))
        for label in plain.core.labels:
            assert mine[label] == pytest.approx(wanted[label], abs=1e-12), (label, on)
        held = (wanted["require"] >= 0.0) & plain.workspace.contains(rows[:15])  # some supports are boxes alone
        assert ((mine["require"] >= 0.0) & choice.workspace.contains(rows) == held).all(), on
        met += int(held.sum())
    assert met > 20


@pytest.mark.parametrize(
    ("text", "place", "words"),
    [
        ("object a, b, c on any of [a, b], by volume", "volume", "without `by area` all are equally likely"),
        ("object a, b, c on any of [a, b] by volume", "by", "write `any of [...] by area`"),
        ("object a, b, c on any of [a, b], by area", "area", "leave out the `,`"),
        ("object can, mug\ntask: above(can, 20 cm)", "above", "write z(can) >= 20 cm"),
        ("object can, mug\ntask: under(can, 20 cm)", "under", "write top(can) <= 20 cm"),
        ("object can, mug\ntask: restsOn(can, 20 cm)", "20 cm", "cabinet.top; a height is compared: z(mug) >= 20 cm"),
        ("object mug, can on 20 cm\ntask: leftOf(can, mug)", "20 cm", "an object or a surface, such as workspace"),
        (
            "object tray, plate, can on any of [tray, plate]\nrequire noOverlap()\ntask: leftOf(can, tray)",
            "noOverlap()",
            "require noCollision() instead",
        ),
    ],
)
def test_mistakes_of_heights_say_what_to_write(text, place, words):
    with pytest.raises(SpecError) as caught:
        check_text(text if "task" in text else f"{text}\ntask: leftOf(a, b)")
    (one,) = caught.value.diagnostics
    assert one.span.text == place and words in one.help


def test_a_choice_that_leaves_the_table_can_be_clear_of_all():
    text = "object tray, plate, can on any of [tray, workspace]\nrequire noOverlap()\ntask: leftOf(can, tray)"
    assert check_text(text).choices


HEAD = """region shelf[2] = rect(0.1, 0.6, 0.9, 0.95) at 30 cm, 60 cm
region mat = rect(0.1, 0.1, 0.4, 0.4)
object tray{tray}, board, can{can}, jar{jar}, dice = box(2 cm, 2 cm, 2 cm){dice}
task: {task}
"""
OPTIONS = {
    "tray": ("shelf[1]", "workspace"),
    "can": ("tray", "board", "shelf[2]", "mat"),
    "jar": ("tray", "can", "workspace"),
    "dice": ("jar", "tray"),
}
TASKS = [
    "supported(can, 1 cm) & leftOf(can, tray)",
    "stable()",
    "stable([tray, can], 2 cm)",
    "z(base(can)) + x(base(jar)) <= 50 cm & dist(base(dice), can) <= 30 cm",
    "gap(base(can), jar) >= 1 cm",
    "restsOn(dice, base(jar)) | inside(dice, base(can))",
    "x(load(tray)) <= 0.5 & y(load(can)) <= 0.5",
    "forall p in objects: x(load(p)) <= 0.5",
    "atLevel(dice, base(jar)) & top(base(can)) <= 40 cm & leftOf(can, tray)",
]


@pytest.mark.parametrize("task", TASKS)
def test_in_each_scene_they_are_those_of_its_surfaces(task):
    among = {name: f" on any of [{', '.join(all_of)}]" for name, all_of in OPTIONS.items()}
    spec = check_text(HEAD.format(**among, task=task))
    rng = np.random.default_rng(5)
    rows = rng.uniform(size=(3 * len(spec.core.objects), 400))
    taken = {spec.objects[which]: chosen_options(choice, rows) for which, choice in spec.choices.items()}
    values = np.broadcast_to(phi(gate(spec.core), rows, NUMPY)["task"], 400)
    compared = 0
    for case in product(*(range(len(all_of)) for all_of in OPTIONS.values())):
        here = np.logical_and.reduce([taken[name] == one for name, one in zip(OPTIONS, case, strict=True)])
        on = {name: f" on {OPTIONS[name][one]}" for name, one in zip(OPTIONS, case, strict=True)}
        if not here.any():
            continue
        alone = check_text(HEAD.format(**on, task=task))
        wanted = np.broadcast_to(phi(gate(alone.core), rows[: 3 * len(spec.objects), here], NUMPY)["task"], here.sum())
        np.testing.assert_allclose(values[here], wanted, rtol=0.0, atol=1e-12)
        compared += int(here.sum())
    assert compared == 400
    assert len({row_of(one.switch, X) for one in spec.choices.values()}) == 4


def test_a_load_takes_surfaces_of_one_carrier_together():
    text = "object shelfunit, can[8] on any of [shelfunit.shelf[1], shelfunit.shelf[2], workspace]\nrequire stable()\n"
    spec = check_text(f"{text}task: leftOf(can[1], shelfunit)")  # 3 ** 8 choices, 2 ** 8 cases
    assert len(spec.choices) == 8


@pytest.mark.parametrize("task", ["theta(base(can)) <= 1", "apart(tray, base(can)) >= 0", "base(can) <= 1"])
def test_what_makes_no_sense_of_surfaces_makes_none_of_those(task):
    with pytest.raises(SpecError, match="surface that differs from scene to scene"):
        check_text(f"object tray, can on any of [tray, workspace]\ntask: {task}")


@pytest.mark.parametrize("lower", ["plate", "bowl", "pot", "tray"])
def test_what_was_declared_to_stand_somewhere_rests_there(lower):
    spec = check_text(f"object {lower}, apple on {lower}\ntask: restsOn(apple, {lower}) & insideOf(apple, {lower})")
    rows = np.full((6, 1), 0.5)
    assert phi(spec.core, rows, NUMPY)["task"][0] >= 0.0


def test_a_bowl_rests_on_the_plate_that_it_stands_in():
    spec = check_text("object plate, bowl on plate\ntask: restsOn(bowl, plate)")
    assert phi(spec.core, np.full((6, 1), 0.5), NUMPY)["task"][0] == pytest.approx(0.001)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("object bowl, plate\ntask: restsOn(bowl, plate) | leftOf(bowl, plate)", True),
        ("object tray, mug on tray, plate\ntask: stackedOn(mug, plate) | leftOf(mug, plate)", True),
        ("object shelfunit, can\ntask: restsOn(can, shelfunit.shelf[2]) | leftOf(can, shelfunit)", True),
        ("object bowl on any of [workspace, plate], plate\ntask: restsOn(bowl, plate)", False),
        ("object bowl on plate, plate, apple on bowl\ntask: insideOf(apple, plate) | leftOf(apple, plate)", False),
        ("object block[3], plate\ntask: exists b in block: restsOn(b, plate) | leftOf(b, plate)", False),
        ("region mat = rect(0, 0, 0.5, 0.5)\nobject can, jar\ntask: restsOn(can, mat) & leftOf(can, jar)", False),
        ("def restsOn(a, b) = leftOf(a, b)\nobject can, jar\ntask: restsOn(can, jar)", False),
    ],
)
def test_what_can_never_rest_there_is_noticed(text, told):
    codes = [one.code for one in check_text(text).warnings]
    assert codes.count("stands-elsewhere") == int(told)
