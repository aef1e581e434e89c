"""Words of other languages get the right name: each help is what it should be, and what it says to write is a spec."""

import re

import pytest

import scenegen
from scenegen.errors import SpecError
from scenegen.lang.syntax.foreign import BODY, COLOR, COUNTING, LYING, PRIOR, RELATIONS, SEEN, SIZES, of_relation, plain

# a spec, and part of the help of its first mistake
HELPS = {
    "near(mug, plate)": "write closeTo(mug, plate, 20 cm)",
    "nextTo(mug, plate)": "alignedY(mug, plate) & closeTo(mug, plate, 20 cm)",
    "next_to(mug, plate)": "alignedY(mug, plate) & closeTo(mug, plate, 20 cm)",
    "beside(mug, plate)": "alignedY(mug, plate)",
    "behind(mug, plate)": "write aboveOf(mug, plate): further from the viewer",
    "inFrontOf(mug, plate)": "write belowOf(mug, plate): nearer to the viewer",
    "in_front_of(mug, plate)": "write belowOf(mug, plate)",
    "IN_FRONT_OF(mug, plate)": "write belowOf(mug, plate)",
    "onTopOf(mug, plate)": "write restsOn(mug, plate)",
    "on_top_of(mug, plate)": "write restsOn(mug, plate)",
    "above(mug, plate)": "z(mug) >= top(plate); `aboveOf` is along y",
    "below(mug, plate)": "write underneath(mug, plate)",
    "left(mug, plate)": "write leftOf(mug, plate)",
    "right_of(mug, plate)": "did you mean `rightOf`?",
    "to_the_left_of(mug, plate)": "write leftOf(mug, plate)",
    "distance(mug, plate) <= 0.2": "write dist(mug, plate)",
    "visible(mug)": SEEN,
    "occluded(mug, plate)": SEEN,
    "reachable(mug)": "write closeTo(mug, (0.5, -0.2), 0.7 m)",
    "graspable(mug)": "forall q in others(mug): gap(mug, q) >= 3 cm",
    "collisionFree(mug, plate)": "write noCollision()",
    "collision_free(objects)": "write noCollision()",
    "parallel(mug, plate)": "abs(sin(theta(mug) - theta(plate))) <= 0.1",
    "contains(tray, mug)": "write inside(mug, tray)",
    "in(mug, tray)": "write inside(a, b)",
    "width(mug) <= 0.2": SIZES.format(a="mug", b="b"),
    "x(mug) <= normal(0.4, 0.1)": PRIOR,
    "object mug at uniform(0, 1), b\ntask: leftOf(b, mug)": PRIOR,
    "object mug at random\ntask: x(mug) <= 0.5": PRIOR,
    "object mug ~ gaussian((0.4, 0.3), 0.1), plate\ntask: leftOf(mug, plate)": PRIOR,
    "x(mug) ~ normal(0.4, 0.1)": PRIOR,
    "leftOf(mug, plate) and ~closeTo(mug, plate)": "write `!` (or `not`)",
    "object mug with probability 0.7\ntask: x(mug) <= 0.5": PRIOR,
    "object mug, plate\ntask: leftOf(mug, plate) with probability 0.7": PRIOR,
    "prior mug: 3": PRIOR,
    "task: 0.7 * leftOf(mug, plate) + 0.3 * rightOf(mug, plate)": "scenegen explain not-here",
    "object mug color red\ntask: x(mug) <= 1": COLOR,
    'object a = box(1 cm, 1 cm, 1 cm) color "red"\ntask: x(a) <= 1': COLOR,
    "object a mass 0.3\ntask: x(a) <= 1": BODY,
    "object a roll 90 deg\ntask: x(a) <= 1": LYING,
    "camera front at (0, 0)\ntask: leftOf(a, b)": SEEN,
    "seed 3\ntask: leftOf(a, b)": "an option of `scenegen sample`",
    "task = leftOf(mug, plate)": "write `task: ...`",
    "object mug, plate\ntask = leftOf(mug, plate)": "write `task: ...`",
    "safe: leftOf(a, b)\ntask = leftOf(b, a)": "write `task: ...`",
    "object a, b\nNEAR = 3 cm\ntask: closeTo(a, b, NEAR)": "write const NEAR = 3 cm",
    "x(a) = x(b)": "abs(x(a) - x(b)) <= 1 cm",
    "x(a) == 30 cm": "abs(x(a) - 30 cm) <= 1 cm",
    "exists o in objects: o == mug & leftOf(o, plate)": "write !(o != mug)",
    "exists o in objects: o is mug & leftOf(o, plate)": "write !(o != mug)",
    "exists o in objects: (o is not mug) & leftOf(o, plate)": "write o != mug",
    "forall i in 1..3: i = 2 -> leftOf(mug, plate)": "write !(i != 2)",
    "object mug, plate\ntask := leftOf(mug, plate)": "write `:`",
    "object mug, plate\nx(mug) ~ uniform(0, 1)\ntask: leftOf(mug, plate)": PRIOR,
    "object mug, plate\nrequire x(mug) = uniform(0, 1)\ntask: leftOf(mug, plate)": PRIOR,
    "x(mug) >= 25%": "write the share as a number, 0.25, times a length",
    "closeTo(mug, plate, 5 in)": "write 12.7 cm",
    "closeTo(mug, plate, 2 ft)": "write 60.96 cm",
    "object red mug\ntask: x(mug) <= 1": COLOR,
    "object big mug\ntask: x(mug) <= 1": "write big_mug",
    'object mug(color = "red")\ntask: x(mug) <= 1': COLOR,
    "object mug of color red\ntask: x(mug) <= 1": COLOR,
    "object cabinet, fork in cabinet.drawer[1]\ntask: x(fork) <= 1": "write `fork on cabinet.drawer[1]`",
    "object tray, mug[3] inside tray\ntask: x(tray) <= 1": "write `mug[3] on tray`",
    "object mug on floor, plate\ntask: leftOf(mug, plate)": "the table is called `workspace`",
    "object mug, cabinet\ntask: closed(cabinet.drawer[1])": "object cabinet = cabinet(3, open = [0.5, 0, 0])",
    "clean(mug)": "not the state that they are in",
    "object mug, plate\ntask: mug is clean": "not the state that they are in",
    "obstructed(mug)": "write reachableFromAbove(mug)",
    "blocked(mug, plate)": "gap(mug, plate) >= 5 cm",
    "accessible(mug)": "write reachableFromAbove(mug)",
    "workspace [0,40] x [0,40] cm\ntask: leftOf(a, b)": "a unit follows each number: [0 cm, 40 cm]",
    "workspace [0,40] cm x [0,40] cm\ntask: leftOf(a, b)": "a unit follows each number: [0 cm, 40 cm]",
    "object block[3,5], b\ntask: leftOf(block[1], b)": "write block[3..5]",
    "object block[3:5], b\ntask: leftOf(block[1], b)": "write block[3..5]",
    "object block[3-5], b\ntask: leftOf(block[1], b)": "write 3..5",
    "object block[3], b\ntask: leftOf(block[1,2], b)": "[block[1], block[2]]",
    "time 10 steps\nobject a, b\ntask: always[0:3] leftOf(a, b)": "write always [0, 3]",
    "time 10 steps\nobject a, b\ntask: G[0:3] leftOf(a, b)": "did you mean `always`?",
    "object a, b\ntask: always[0:3] leftOf(a, b)": "time 20 steps",
    "object a, b\ntask: G[0,3] leftOf(a, b)": "time 20 steps",
    "mug left of plate": "write leftOf(mug, plate)",
    "mug is to the left of the plate": "write leftOf(mug, plate)",
    "mug next to plate": "alignedY(mug, plate)",
    "mug in front of plate": "write belowOf(mug, plate)",
    "mug on top of plate": "write restsOn(mug, plate)",
    "mug is facing plate": "write facing(mug, plate)",
    "distance mug plate <= 3": "write dist(mug, plate)",
    "object mug on top of plate, plate\ntask: leftOf(mug, plate)": "write `mug on plate`",
    "object mug left of plate, plate\ntask: leftOf(mug, plate)": "in a formula write leftOf(mug, plate)",
    "leftOf(a, b) iff leftOf(b, a)": "write (a -> b) & (b -> a)",
    "leftOf(a, b) xor leftOf(b, a)": "write (a | b) & !(a & b)",
    "x(a) in [0.2, 0.4]": "write 0.2 <= x(mug) <= 0.4",
    "task: count(p in block: leftOf(p, a)) >= 2": COUNTING,
}


@pytest.mark.parametrize("text", HELPS)
def test_the_help(text):
    with pytest.raises(SpecError) as caught:
        scenegen.parse(text)
    assert HELPS[text] in caught.value.diagnostics[0].help


def test_time_that_runs_backwards():
    with pytest.raises(SpecError) as caught:
        scenegen.parse("time -1 steps\nobject a, b\ntask: leftOf(a, b)")
    (problem,) = caught.value.diagnostics
    assert (problem.code, problem.title) == ("horizon-out-of-range", "a motion cannot have -1 steps")


@pytest.mark.parametrize("name", [name for name in RELATIONS if RELATIONS[name].startswith("write")])
def test_what_is_to_be_written_is_known(name):
    """Every relation and function of the advice is one that there is."""
    told = of_relation(name, ("mug", "plate"))
    from scenegen.lang.check.scope import groups, signatures

    known = {*signatures(), *(one.name for group in groups() for one in group.entries)}
    assert set(re.findall(r"(\w+)\(", told)) <= known
    assert plain(name) == name


def test_the_names_of_formats(tmp_path):
    from scenegen.errors import RequestError
    from scenegen.worlds.files import chosen

    for name, meant in {"mujoco": "mjcf", "Isaac-Sim": "usd", "gazebo": "sdf", "isaac": "usd"}.items():
        with pytest.raises(RequestError, match="unknown format") as caught:
            chosen(name, tmp_path)
        assert f"the format for {name} is `{meant}`" in caught.value.diagnostics[0].help
