"""What `object a on b` means: heights, boxes, requirements; and bodies that share no space, against another oracle."""

import numpy as np
import pytest

import scenegen
from scenegen.errors import Source, SpecError
from scenegen.lang.checker import check_text
from scenegen.lang.formula.core import Atom
from scenegen.lang.formula.interpret import phi as evaluate
from scenegen.lang.syntax.printer import format_source
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
