"""Planning problems become specs that check; what has no geometry is told; hostile text is one diagnostic."""

import itertools
from pathlib import Path

import numpy as np
import pytest

import scenegen
from scenegen.api.scenes import evaluate
from scenegen.errors import ScenegenError
from scenegen.lang.checker import check_text
from scenegen.planning.conversion import Imported, import_problem

KITCHEN = """
(define (problem own_kitchen) (:domain robosuite) (:language put the bowl on the plate)
  (:regions
    (plate_place (:target kitchen_table) (:ranges ((-0.05 -0.25 0.0 -0.2))) (:yaw_rotation ((0.0 0.0))))
    (bowl_place (:target kitchen_table) (:ranges ((0.1 0.0 0.15 0.05))))
    (stove_place (:target kitchen_table) (:ranges ((-0.31 0.29 -0.29 0.31))))
    (cook_region (:target flat_stove_1)))
  (:fixtures kitchen_table - kitchen_table flat_stove_1 - flat_stove)
  (:objects white_bowl_1 - white_bowl plate_1 - plate)
  (:init (On white_bowl_1 kitchen_table_bowl_place) (On plate_1 kitchen_table_plate_place)
    (On flat_stove_1 kitchen_table_stove_place))
  (:goal (And (On white_bowl_1 GOAL) (Turnon flat_stove_1))))
"""
HOUSE = """
(define (problem own_house) (:domain igibson)
  (:objects cup.n.01_1 cup.n.01_2 - cup.n.01 table.n.02_1 - table.n.02 floor.n.01_1 - floor.n.01)
  (:init (onfloor cup.n.01_1 floor.n.01_1) (onfloor cup.n.01_2 floor.n.01_1) (inroom floor.n.01_1 kitchen))
  (:goal FORMULA))
"""


def imported(folder: Path, text: str) -> Imported:
    path = folder / "task.bddl"
    path.write_text(text)
    return import_problem(path)


@pytest.mark.parametrize("carrier", ["plate_1", "flat_stove_1_cook_region"])
def test_kitchen(tmp_path: Path, carrier: str) -> None:
    made = imported(tmp_path, KITCHEN.replace("GOAL", carrier))
    spec = check_text(made.text, "task.spec")
    assert spec.labels == ("start", "goal")
    assert [line.partition(": ")[2] for line in made.lost] == ["(Turnon flat_stove_1)"]
    assert "# without geometry, line 12: (Turnon flat_stove_1)" in made.text
    assert ("<= 0.03 m" in made.text) == (carrier == "plate_1")


@pytest.mark.parametrize(
    ("formula", "part"),
    [
        ("(forall (?c - cup.n.01) (ontop ?c ?table.n.02_1))", "restsOn(cup_2, table_1_board)"),
        ("(exists (?c - cup.n.01) (under ?c table.n.02_1))", "| underneath(cup_2, table_1_board)"),
        ("(forn (1) (?c - cup.n.01) (ontop ?c table.n.02_1))", "!(restsOn"),
        ("(forpairs (?c - cup.n.01) (?t - table.n.02) (ontop ?c ?t))", "|"),
        ("(and (nextto cup.n.01_1 cup.n.01_2) (not (touching cup.n.01_1 cup.n.01_2)))", "gap(cup_1, cup_2) <= 15 cm"),
    ],
)
def test_house(tmp_path: Path, formula: str, part: str) -> None:
    goal = imported(tmp_path, HOUSE.replace("FORMULA", formula)).text.partition("\ngoal:")[2]
    assert part in " ".join(goal.split())


def test_a_disjunction_with_what_has_no_geometry_is_left_out(tmp_path: Path) -> None:
    formula = "(and (ontop cup.n.01_1 table.n.02_1) (or (dusty cup.n.01_2) (ontop cup.n.01_2 table.n.02_1)))"
    goal = imported(tmp_path, HOUSE.replace("FORMULA", formula)).text.partition("\ngoal:")[2]
    assert "cup_1" in goal
    assert "cup_2" not in goal


def test_what_the_goal_takes_off_its_carrier_can_be_elsewhere(tmp_path: Path) -> None:
    text = HOUSE.replace("(onfloor cup.n.01_1 floor.n.01_1)", "(ontop cup.n.01_1 table.n.02_1)")
    made = imported(tmp_path, text.replace("FORMULA", "(not (ontop cup.n.01_1 table.n.02_1))"))
    assert "object cup_1 = cup on any of [workspace, table_1_board]" in made.text
    assert "object cup_2 = cup  #" in made.text


def test_what_is_clear_at_first_need_not_stay_so(tmp_path: Path) -> None:
    blocks = "(define (problem p) (:objects a b - block) (:init (clear a) (clear b) (on-table b)) (:goal (on a b)))"
    text = imported(tmp_path, blocks).text
    assert "require reachableFromAbove" not in text
    assert "reachableFromAbove(b)" in text.partition("start:")[2].partition("goal:")[0]


BLOCKS_ON = "(define (problem p) (:objects a b - block) (:goal (on a b)))"


def test_a_thing_may_be_declared_twice_as_the_same(tmp_path: Path) -> None:
    twice = BLOCKS_ON.replace("- block", "- block a - block")
    assert imported(tmp_path, twice).text.count("object a ") == imported(tmp_path, BLOCKS_ON).text.count("object a ")


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("(" * 100_000, "pddl-text"),
        ("(define (problem a)", "pddl-text"),
        ("(define))", "pddl-text"),
        ("(define \0)", "pddl-text"),
        ("", "pddl-no-problem"),
        (" " * 4_000_001, "too-large-to-read"),
        (HOUSE.replace("FORMULA", "(dusty cup.n.01_1)"), "no-spatial-goal"),
        (HOUSE.replace("FORMULA", "(ontop cup.n.01_1 nothing)"), "pddl-unknown-name"),
        (HOUSE.replace("FORMULA", "(ontop cup.n.01_1)"), "pddl-form"),
        (HOUSE.replace("- table.n.02 ", "- zeppelin.n.01 "), "unknown-category"),
        (BLOCKS_ON.replace("(:goal", "(:goal (on b a)) (:goal"), "pddl-form"),
        (BLOCKS_ON.replace("- block", "- block a - mug"), "pddl-form"),
        (BLOCKS_ON.replace("a b", "a b " + " ".join(f"c{k}" for k in range(199))), "pddl-too-large"),
    ],
)
def test_bad_text_is_one_diagnostic(tmp_path: Path, text: str, code: str) -> None:
    with pytest.raises(ScenegenError) as raised:
        imported(tmp_path, text)
    assert [one.code for one in raised.value.diagnostics] == [code]


@pytest.mark.parametrize(
    ("formula", "words"),
    [
        ("nosuch($1, $2)", "unknown relation `nosuch`"),
        ("closeTo($1, $9, 1 m)", "2 arguments in a fact, and the formula names $1 and $9"),
        ("closeTo($0, $1)", "names $0 and $1"),
        ("x($1) >= 1", "names $1"),
        ("true", "names none"),
        ("closeTo($1, $2", "never closed"),
        ("$1 $2", "missing `,` or operator"),
        ("near($1, $2)", "unknown relation `near`"),
        ("dist($1, $2)", "`near`, means nothing"),
    ],
)
def test_a_formula_of_a_map_that_means_nothing_is_named(tmp_path: Path, formula: str, words: str) -> None:
    (tmp_path / "p.pddl").write_text("(define (problem p) (:objects a b - block) (:goal (near a b)))")
    (tmp_path / "m.toml").write_text(f'[predicates]\nnear = "{formula}"')
    with pytest.raises(ScenegenError) as caught:
        import_problem(tmp_path / "p.pddl", table=tmp_path / "m.toml")
    (one,) = caught.value.diagnostics
    assert one.code == "facts-mean-nothing" and formula in one.title and words in one.title


def test_what_a_domain_declares_may_have_arguments_that_say_nothing(tmp_path: Path) -> None:
    (tmp_path / "d.pddl").write_text("(define (domain d) (:predicates (low ?a ?b)))")
    (tmp_path / "p.pddl").write_text("(define (problem p) (:domain d) (:objects a b - block) (:goal (low a b)))")
    (tmp_path / "m.toml").write_text('[predicates]\nlow = "x($1) <= 0.5"')
    assert "x(a) <= 0.5" in import_problem(tmp_path / "p.pddl", tmp_path / "d.pddl", tmp_path / "m.toml").text


@pytest.mark.parametrize("goal", ["(and)", "(or)", "(on a a)"])
def test_a_goal_that_is_constant_is_not_a_matter_of_sizes(tmp_path: Path, goal: str) -> None:
    (tmp_path / "p.pddl").write_text(f"(define (problem p) (:objects a b - block) (:goal {goal}))")
    with pytest.raises(ScenegenError, match="`goal` is constant") as caught:
        import_problem(tmp_path / "p.pddl")
    assert "in every scene or in none" in caught.value.diagnostics[0].help


def goal_of(folder: Path, objects: str, goal: str, init: str = "", table: str = "", domain: str = "") -> Imported:
    """A PDDL problem, imported with a map and a domain, where there are any."""
    files = {"p.pddl": f"(define (problem p) (:objects {objects}) (:init {init}) (:goal {goal}))"}
    files |= {"m.toml": table} if table else {}
    files |= {"d.pddl": f"(define (domain d) {domain})"} if domain else {}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    paths = [folder / "d.pddl" if domain else None, folder / "m.toml" if table else None]
    made = import_problem(folder / "p.pddl", *paths)
    check_text(made.text, "task.spec")
    return made


def written(made: Imported, part: str = "\ngoal:") -> str:
    return " ".join(made.text.partition(part)[2].partition("\n\n")[0].split())


NEXT = "0 m <= gap({0}) & gap({0}) <= 15 cm"


@pytest.mark.parametrize(
    ("objects", "goal", "wanted"),
    [  # A3: a thing of several types is of each of them, in objects, quantifiers, types and predicates
        ("a1 - apple c1 - can t - bowl", "(forall (?x - (either apple can)) (nextto ?x t))", "gap(c1, t)"),
        ("m - (either cup mug) t - bowl p - plate", "(forall (?x - mug) (on ?x p))", "restsOn(m, p)"),
        ("m - (either cup mug) t - bowl p - plate", "(forall (?x - cup) (on ?x p))", "restsOn(m, p)"),
        # A4: names are compared without case
        ("a b c - Block", "(and (on a b) (forall (?x - block) (clear ?x)))", "reachableFromAbove(c)"),
        ("A B - block", "(on a b)", "restsOn(A, B)"),
        ("A B C - block", "(forall (?X - BLOCK) (or (= ?x c) (on ?x C)))", "restsOn(A, C) & restsOn(B, C)"),
        # words that end where the next one begins
        ("a b - block", "(exists(?x?y - block)(and(not(= ?x b))(on?x?y)))", "restsOn(a, b)"),
        ("a b -block c-1 -(either mug cup)", "(on?a c-1)", "restsOn(a, c_1)"),
        ("a b- block c- mug", "(exists (?x- mug) (on ?x a))", "restsOn(c, a)"),
        ("a b - block", "(and (on a b) (nextto? a b) (<= -0.5 -.5))", "restsOn(a, b)"),
        # B1: nothing is in a relation with itself
        ("a b c - cup", "(forall (?x - cup) (or (nextto ?x a) (nextto ?x b)))", "gap(c, a)"),
        (
            "a b - block",
            "(forall (?x ?y - block) (not (touching ?x ?y)))",
            "!(apart(a, b) <= EPS_TOUCH) & ",
        ),
        ("a b - block", "(or (touching a a) (on a b))", "restsOn(a, b)"),
        # B2: names decide equality
        ("a b - block", "(forall (?x ?y - block) (imply (not (= ?x ?y)) (nextto ?x ?y)))", "gap(b, a)"),
        ("a b - block", "(and (on a b) (forall (?x - block) (or (= ?x a) (on-table ?x))))", "z(b) <= EPS_LEVEL"),
        ("a b - block", "(exists (?x - block) (and (not (= ?x b)) (on ?x b)))", "restsOn(a, b)"),
        # B10: constants of the prelude, keywords, digits first, dashes
        ("NORTH not - block", "(on north Not)", "restsOn(NORTH_, not_)"),
        ("EPS_CLOSE workspace - block", "(on eps_close workspace)", "restsOn(EPS_CLOSE_, workspace_)"),
        ("2x a-b - block", "(on 2x a-b)", "restsOn(a_2x, a_b)"),
        ("a b (:private c - block) - block", "(on a c)", "restsOn(a, c)"),
    ],
)
def test_names_mean_what_they_do_elsewhere(tmp_path: Path, objects: str, goal: str, wanted: str) -> None:
    made = goal_of(tmp_path, objects, goal, "(at 5 (on-table nothing))")
    assert wanted in written(made)


TASKS = sorted((Path(__file__).parent / "tasks").glob("*.bddl"))


@pytest.mark.parametrize("case", ["bowl_drawer_stack", "caddy", "microwave", "spatial", "house", "own"])
def test_capitals_mean_what_small_letters_mean(tmp_path: Path, case: str) -> None:
    """Types, things, regions, the sites of furniture and key words."""
    own = """(define (problem p) (:objects a - apple.n.01 b -object Study_Table - desk)
      (:regions (r (:target study_table) (:ranges ((0 0 .1 .1))))) (:goal (and (on a study_table_r) (nextto a b))))"""
    house = HOUSE.replace("FORMULA", "(forall (?c - cup.n.01) (or (= ?c cup.n.01_1) (ontop ?c table.n.02_1)))")
    text = {"house": house, "own": own, **{one.stem: one.read_text() for one in TASKS}}[case]
    plain = imported(tmp_path, text)
    for other in (text.upper(), text.title(), text.swapcase()):
        made = imported(tmp_path, other)
        assert made.text.lower() == plain.text.lower()
        assert [one.lower() for one in made.lost] == [one.lower() for one in plain.lost]


def test_comments_may_be_in_any_encoding(tmp_path: Path) -> None:
    text = BLOCKS_ON.replace("(:goal", "; caf\xe9 ?\n(:goal") + "; \xe9t\xe9"
    (tmp_path / "p.pddl").write_bytes(text.encode("latin-1"))
    assert "restsOn" in import_problem(tmp_path / "p.pddl").text
    (tmp_path / "p.pddl").write_bytes(text.replace("(:objects", "(:objects caf\xe9").encode("latin-1"))
    with pytest.raises(ScenegenError, match="holds a character that no PDDL file has") as caught:
        import_problem(tmp_path / "p.pddl")
    (only,) = caught.value.diagnostics
    assert only.span is not None and only.span.source.text[: only.span.start].endswith("(:objects caf")


def test_types_are_those_of_the_domain(tmp_path: Path) -> None:
    domain = "(:types Apple Can - (either Fruit Tin) Fruit Tin - object) (:constants T - bowl)"
    domain += " (:predicates (near ?a - (either apple can) ?b - bowl) (ON ?a ?b) (lit ?a))"
    goal = "(and (forall (?x - FRUIT) (near ?x t)) (exists (?x - tin) (on ?x T)))"
    made = written(goal_of(tmp_path, "a - apple c - can", goal, domain=domain))
    assert made.startswith("(closeTo(a, T)) & (closeTo(c, T))") or "closeTo(c, T)" in made
    assert "restsOn(a, T) | restsOn(c, T)" in made
    with pytest.raises(ScenegenError, match="unknown type `movable`"):
        goal_of(tmp_path, "a b - block", "(and (on a b) (forall (?x - movable) (clear ?x)))")


@pytest.mark.parametrize(
    ("goal", "lost"),
    [
        ("(and (on a b) (<= (weight a) 10))", ["(<= (weight a) 10)"]),
        ("(and (on a b) (= (count) 3))", ["(= (count) 3)"]),
        ("(and (on a b) (>= load 3) (= load 3))", ["(>= load 3)", "(= load 3)"]),
        ("(and (on a b) (preference p1 (on b c)))", ["(preference p1 (on b c))"]),
        ("(and (on a b) (within 5 (on b c)))", ["(within 5 (on b c))"]),
        ("(and (on a b) (on (top b) c))", ["(on (top b) c)"]),
        ("(and (on a b) (or (clear c) (> (w a) 3)))", ["(> (w a) 3)", "(or (clear c) (> (w a) 3))"]),
        ("(and (on a b) (not (and (clear c) (hot a))))", ["(hot a)", "(not (and (clear c) (hot a)))"]),
        ("(and (on a b) (imply (hot a) (clear c)))", ["(hot a)", "(imply (hot a) (clear c))"]),
        ("(and (on a b) (exists (?x - block) (hot ?x)))", ["(hot ?x)"]),
    ],
)
def test_what_is_no_relation_is_left_out_by_name(tmp_path: Path, goal: str, lost: list[str]) -> None:
    init = "(at 5 (not (on-table b))) (= (total-cost) 0) (on c c) (on-table b)"
    made = goal_of(tmp_path, "a b c - block", goal, init)
    told = [one.split(": ", 1)[1] for one in made.lost]
    assert told == [*lost, "(at 5 (not (on-table b)))", "(= (total-cost) 0)", "(on c c)"]
    assert written(made) == "restsOn(a, b)"


def test_pairs_are_a_one_to_one_mapping(tmp_path: Path) -> None:
    """Against a search over all mappings, of random scenes."""
    goal = "(forpairs (?p - plate) (?c - cup) (nextto ?p ?c))"
    spec = scenegen.parse(goal_of(tmp_path, "p q r - plate c d e - cup", goal).text)
    scenes = scenegen.sample(spec, n=300, seed=1)
    near = {}
    for pair in itertools.product("pqr", "cde"):
        things = "object p = plate, q = plate, r = plate, c = cup, d = cup, e = cup"
        one = scenegen.parse(f"{things}\ntask: {NEXT.format(', '.join(pair))}").checked
        near[pair] = evaluate(one, scenes)["task"]
    ways = [[near[pair] for pair in zip("pqr", others, strict=True)] for others in itertools.permutations("cde")]
    np.testing.assert_allclose(scenes.phi["goal"], np.max(np.min(ways, axis=1), axis=0), atol=1e-12)
    assert len(np.unique(np.argmax(np.min(ways, axis=1), axis=0))) == 6


@pytest.mark.parametrize("count", [2, 5, 7])
def test_nothing_is_a_partner_of_itself(tmp_path: Path, count: int) -> None:
    things = " ".join(f"c{number}" for number in range(count))
    if count < 7:  # of seven, the texts of all the ways take seconds to read
        made = goal_of(tmp_path, f"{things} - cup", "(fornpairs (2) (?a - cup) (?b - cup) (nextto ?a ?b))")
        assert "gap(c0, c0)" not in made.text and "gap(c1, c0)" in made.text
    whole = goal_of(tmp_path, f"{things} - cup", "(forpairs (?a - cup) (?b - cup) (nextto ?a ?b))")
    assert bool(whole.lost) == (count == 7) and all(one.startswith("kept in part") for one in whole.lost)


def test_one_map_serves_several_problems(tmp_path: Path) -> None:
    table = '[objects]\n"CAR.n.01" = "block"\nWidget = "block"\nblok = "block"\n'
    table += '[predicates]\nStacked-On = "on"\nfar = "none"\n'
    made = goal_of(tmp_path, "a - widget b c - block", "(stacked_on a b)", table=table)
    assert written(made) == "restsOn(a, b)"
    assert [(one.code, one.severity, one.facts["names"]) for one in made.warnings] == [
        ("map-names-nothing", "note", ["blok"]),
        ("map-names-nothing", "note", ["CAR.n.01", "far"]),
    ]
    assert "did you mean `block`" in made.warnings[0].help


@pytest.mark.parametrize(
    ("goal", "code", "proposed"),
    [
        ("(and (on a b) (near? a b))", "unknown-predicate", '"near?" = "restsOn($1, $2)"'),
        ("(and (on a b) (über a b))", "unknown-predicate", '"über" = "restsOn($1, $2)"'),
        ("(and (on a b) (shiny a))", "unknown-predicate", 'shiny = "reachableFromAbove($1)"'),
        ("(and (on a b) (rainy))", "unknown-predicate", 'rainy = "none"'),
        ("(near? a b)", "no-spatial-goal", '"near?" = "closeTo($1, $2)"'),
        ("(= (count) 3)", "no-spatial-goal", ""),
        ("(on a r)", "no-spatial-goal", 'robot = "cylinder(20 cm, 1 m)"'),
    ],
)
def test_what_is_proposed_for_a_map_is_one(tmp_path: Path, goal: str, code: str, proposed: str) -> None:
    try:
        (one,) = goal_of(tmp_path, "a b - block r - robot", goal).warnings
    except ScenegenError as error:
        (one,) = error.diagnostics
    assert one.code == code and proposed in one.help
    table = "objects" if "robot" in proposed else "predicates"
    if proposed:
        goal_of(tmp_path, "a b - block r - robot", f"(and (nextto a b) {goal})", table=f"[{table}]\n{proposed}\n")


@pytest.mark.parametrize(
    ("goal", "code"),
    [("(on a c)", "pddl-unknown-name"), ("(on a_1 b)", "pddl-unknown-name"), ("(= a c)", "pddl-unknown-name")],
)
def test_what_nothing_declares_is_told(tmp_path: Path, goal: str, code: str) -> None:
    with pytest.raises(ScenegenError) as caught:
        goal_of(tmp_path, "a b - block", f"(and (nextto a b) {goal})")
    assert [one.code for one in caught.value.diagnostics] == [code]


def test_a_site_of_a_thing_is_the_thing(tmp_path: Path) -> None:
    text = KITCHEN.replace("(cook_region", "(contain_region (:target basket_1)) (cook_region")
    text = text.replace("plate_1 - plate)", "plate_1 - plate basket_1 - basket)").replace(
        "(On white_bowl_1 GOAL)", "IN"
    )
    made = imported(tmp_path, text.replace("IN", "(In White_Bowl_1 Basket_1_Contain_Region)"))
    assert "insideOf(white_bowl_1, basket_1)" in made.text
    made = imported(tmp_path, text.replace("IN", "(On basket_1_contain_region plate_1)"))
    assert "restsOn(basket_1, plate_1" in made.text


def test_regions_beyond_the_table_make_it_larger(tmp_path: Path) -> None:
    text = KITCHEN.replace("(0.1 0.0 0.15 0.05)", "(0.1 -2.0 0.15 -1.95)").replace("GOAL", "plate_1")
    assert "workspace [-0.5, 0.5] x [-2, 0.6]" in imported(tmp_path, text).text


def test_two_floors_are_one_ground(tmp_path: Path) -> None:
    text = HOUSE.replace("floor.n.01_1 - floor", "floor.n.01_1 floor.n.01_2 - floor")
    goal = "(and (nextto cup.n.01_1 cup.n.01_2) (ontop cup.n.01_1 floor.n.01_2) (not (ontop cup.n.01_2 floor.n.01_2)))"
    made = imported(tmp_path, text.replace("FORMULA", goal))
    assert written(made) == f"({NEXT.format('cup_1, cup_2')}) & z(cup_1) <= EPS_LEVEL"
    assert [one.partition(",")[0] for one in made.lost] == ["left out", "without geometry", "without geometry"]
    assert "\nstart:" not in made.text and "# every scene is a start" in made.text


@pytest.mark.parametrize("mark", ["", "\ufeff"])
def test_files_may_begin_with_a_byte_order_mark(tmp_path: Path, mark: str) -> None:
    made = goal_of(tmp_path, "a b - gadget", "(on a b)", table=f'{mark}[objects]\ngadget = "block"\n')
    assert written(made) == "restsOn(a, b)"


def test_what_else_a_problem_has_is_told(tmp_path: Path) -> None:
    """Sections that are not read, and a predicate of the domain that is called as one of ours."""
    text = "(define (problem p) (:objects a b - block) (:constraints (always (clear a))) (:goal (on a b)))"
    assert imported(tmp_path, text).lost == ("not read, line 1: (:constraints (always (clear a)))",)
    made = goal_of(tmp_path, "a b - block", "(and (on a) (nextto a b))", domain="(:predicates (on ?x) (nextto ?a ?b))")
    assert [one.code for one in made.warnings] == ["unknown-predicate"] and "nearest" not in made.warnings[0].help
    assert made.lost == ("without geometry, line 1: (on a)",)
