"""Every mistake a spec can hold and what the user reads about it: the corpora of golden/lang/errors. What
the checker lets pass, but not without a word; and where words would be out of place. Words of other languages get
the right name: each help is what it should be, and what it says to write is a spec.
"""

import functools
import re
from pathlib import Path

import pytest

import scenegen
from scenegen.errors import SpecError
from scenegen.lang.checker import check
from scenegen.lang.syntax.foreign import (
    BODY_HELP,
    CAMERA_HELP,
    COLOR,
    COUNTING,
    LYING,
    PRIOR,
    RELATIONS,
    SIZES_HELP,
    of_relation,
    plain,
)
from scenegen.lang.syntax.parse import read_source

from ..corpus import GOLDEN, read_corpus
from .worth import warnings

ROOT = Path(__file__).resolve().parents[2]
CORPORA = [f"lang/errors/{path.stem}" for path in sorted((GOLDEN / "lang" / "errors").glob("*.txt"))]
CASES = [(name, case) for name in CORPORA for case in read_corpus(name).values()]
SPECS = [case for _, case in CASES]


@functools.cache
def diagnostics(case):
    with pytest.raises(SpecError) as refused:
        check(read_source(f"{case.name}.spec", case.text.encode()))
    return refused.value


@pytest.mark.parametrize(("corpus", "case"), CASES, ids=[case.name for case in SPECS])
def test_the_message(corpus, case, message):
    message(corpus, case.name, str(diagnostics(case)))


def test_each_name_stands_for_one_case():
    assert len(SPECS) == len({case.name for case in SPECS}) >= 465


def test_every_message_has_a_place_inside_the_text_and_says_something_beside_its_title():
    for case in SPECS:
        for one in diagnostics(case).diagnostics:
            assert one.span is not None, case.name
            assert 0 <= one.span.start <= one.span.end <= len(one.span.source.text), case.name
            assert one.span.source.name == f"{case.name}.spec", case.name


def test_no_name_of_the_grammar_gets_out():
    grammar = (ROOT / "grammar" / "spec.lark").read_text(encoding="utf-8")
    terminals = set(re.findall(r"^(_?[A-Z]+)(?:\.\d+)?:", grammar, re.MULTILINE)) - {"X"}
    assert {"NAME", "_AND", "QUANTITY", "LABEL"} <= terminals
    names = terminals | {"RPAR", "LPAR", "RSQB", "LSQB", "EQUAL", "COLON", "COMMA", "$END", "__ANON_0", "ladder"}
    for case in SPECS:
        own = set(re.findall(r"\w+", case.text))
        for one in diagnostics(case).diagnostics:
            said = set(re.findall(r"[$\w]+", f"{one.title} {one.label} {one.help} {one.note}"))
            assert not (said & names) - own, case.name


TASK = "task: leftOf(mug, plate)"

HEADING = "a heading is compared as a number: it jumps from 2 pi to 0 at EAST"

NOTICED = [
    (f"const A = 1\n{TASK}", [("the constant `A` is never used", "A")]),
    (f"region r = rect(0, 0, 1, 1)\n{TASK}", [("the region `r` is never used", "r")]),
    (f"def f(a) = leftOf(a, plate)\n{TASK}", [("the definition `f` is never used", "f")]),
    (
        f"def f(a) = g(a)\ndef g(a) = leftOf(a, plate)\n{TASK}",
        [("the definition `f` is never used", "f"), ("the definition `g` is never used", "g")],
    ),
    ("def f(a, b) = leftOf(a, plate)\ntask: f(mug, mug)", [("the parameter `b` is never used", "b")]),
    (
        "object mug, plate\ndef f(mug) = leftOf(mug, plate)\ntask: f(mug)",
        [("the parameter `mug` hides an object of that name", "mug")],
    ),
    (
        "object mug, box[2]\ndef f(box) = leftOf(box, mug)\ntask: f(box[1])",
        [("the parameter `box` hides an array of that name", "box")],
    ),
    (
        "def f(EPS_CLOSE) = leftOf(EPS_CLOSE, mug)\ntask: f(plate)",
        [("the parameter `EPS_CLOSE` hides a constant of that name", "EPS_CLOSE")],
    ),
    (
        "def f(safe) = leftOf(safe, mug)\ntask: f(plate)\nsafe: leftOf(mug, plate)",
        [("the parameter `safe` hides a label of that name", "safe")],
    ),
    (
        "region r = rect(0, 0, 1, 1)\nobject a[2]\ntask: inside(a[1], r) & forall r in a: leftOf(r, (1, 1))",
        [("the variable `r` hides a region of that name", "r")],
    ),
    ("object a[2]\ntask: forall i in 1..2: leftOf(a[1], a[2])", [("the variable `i` is never used", "i")]),
    ("theta(mug) <= 0.5 rad & leftOf(mug, cup)", [(HEADING, "theta(mug) <= 0.5 rad")]),
    ("abs(theta(mug) - theta(cup)) <= 20 deg", [(HEADING, "abs(theta(mug) - theta(cup)) <= 20 deg")]),
    ("abs(wrap(theta(mug) / 2)) <= 20 deg", [(HEADING, "abs(wrap(theta(mug) / 2)) <= 20 deg")]),
    (
        "def h(a) = mean(theta(a), NORTH)\ntask: !(0 deg <= h(mug) <= 90 deg) | leftOf(mug, cup)",
        [(HEADING, "(0 deg <= h(mug) <= 90 deg)")],
    ),
    ("forall p, q in [mug, plate]: leftOf(p, cup)", [("the variable `q` is never used", "q")]),
    (
        "object crackrbox, plat\ntask: leftOf(crackrbox, plat)",
        [
            ("the library has no `crackrbox`: a block of 5 cm stands in for it", "crackrbox"),
            ("the library has no `plat`: a block of 5 cm stands in for it", "plat"),
        ],
    ),
    ("leftOf(mug, plat)", [("the library has no `plat`: a block of 5 cm stands in for it", "plat")]),
    (
        "object red_mug, b\n" + TASK.replace("mug, plate", "red_mug, b"),
        [("the library has no `red_mug`: a block of 5 cm stands in for it", "red_mug")],
    ),
]

QUIET = [
    "const EPS_CLOSE = 1\ntask: closeTo(mug, plate)",
    "const EPS_CLOSE = 2 * HALF\nconst HALF = 5 cm\ntask: closeTo(mug, plate)",
    "const N = 3\nobject block[N]\ntask: leftOf(block[1], block[2])",
    "region r = rect(0, 0, W, 1)\nconst W = 1\ntask: inside(mug, r)",
    "const HOME = (0.5, 0.5)\nobject tray at HOME, mug\ntask: leftOf(mug, tray)",
    "def f(a, e = SLACK) = closeTo(a, plate, e)\nconst SLACK = 1\nrequire f(mug)\ntask: leftOf(mug, plate)",
    "def f(p) = leftOf(p, plate)\ntask: f(p)",  # the only p is the object that the label names: nothing is hidden
    "object a, spare\ntask: x(a) <= 1",
    "object house, plant, pan, jug, knife_block, block_tower, coaster, lamp\ntask: leftOf(house, plant)",
    "object plat = box(5 cm, 5 cm, 5 cm), Mug2, fork_2, can3\ntask: leftOf(plat, Mug2)",
    "import_: leftOf(a, b)",
    "angle(a, theta(b)) & facing(a, b) & sameHeading(a, b) & mirrored(a, b) & noOverlap([a, b]) & fullyLeftOf(a, b)",
    "abs(wrap(theta(a) - 2 * theta(b) + NORTH)) <= 1 rad & sin(3 * theta(a)) <= cos(-theta(b))",
    "reach(a, theta(b) - NORTH) <= reach(b, theta(a)) & sum(theta(a), -theta(a)) <= x(b) * 1 rad / 1 m",
    "object tray at (0.5, 0.5, 20 deg), mug\ntask: theta(tray) * x(mug) <= 1 m * 1 rad",
]


@pytest.mark.parametrize(("text", "expected"), NOTICED)
def test_noticed(text, expected):
    assert warnings(text) == expected


@pytest.mark.parametrize("text", QUIET)
def test_quiet(text):
    assert warnings(text) == []


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
    "isVisible(mug)": CAMERA_HELP.format(a="mug"),
    "occluded(mug, plate)": CAMERA_HELP.format(a="mug"),
    "inReach(mug)": "write reachable(mug, arm): robot arm = panda at (0.5, -0.25, NORTH)",
    "canGrasp(mug)": "write graspable(mug, arm): robot arm = panda at (0.5, -0.25, NORTH)",
    "collisionFree(mug, plate)": "write noCollision()",
    "collision_free(objects)": "write noCollision()",
    "parallel(mug, plate)": "abs(sin(theta(mug) - theta(plate))) <= 0.1",
    "contains(tray, mug)": "write inside(mug, tray)",
    "in(mug, tray)": "write inside(a, b)",
    "width(mug) <= 0.2": SIZES_HELP.format(a="mug", b="b"),
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
    "object a mass 0.3\ntask: x(a) <= 1": BODY_HELP,
    "object a roll 90 deg\ntask: x(a) <= 1": LYING,
    "camera front at (0, 0)\ntask: leftOf(a, b)": CAMERA_HELP.format(a="mug"),
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
    "x(mug) >= 25%": "write the share times a length: 25 % * 1 m",
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
    from scenegen.worlds.exporting import export_format

    for name, meant in {"mujoco": "mjcf", "Isaac-Sim": "usd", "gazebo": "sdf", "isaac": "usd"}.items():
        with pytest.raises(RequestError, match="unknown format") as caught:
            export_format(name, tmp_path)
        assert f"the format for {name} is `{meant}`" in caught.value.diagnostics[0].help
