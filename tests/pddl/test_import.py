"""Planning problems become specs that check; what has no geometry is told; hostile text is one diagnostic."""

from pathlib import Path

import pytest

from scenegen.api.planning import Imported, import_problem
from scenegen.errors import ScenegenError
from scenegen.lang.check import check_text

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
        ("(" * 100_000, "pddl-too-deep"),
        ("(define (problem a)", "pddl-brackets"),
        ("(define))", "pddl-brackets"),
        ("(define \0)", "pddl-character"),
        ("", "pddl-no-problem"),
        (" " * 4_000_001, "too-large-to-read"),
        (HOUSE.replace("FORMULA", "(dusty cup.n.01_1)"), "no-spatial-goal"),
        (HOUSE.replace("FORMULA", "(ontop cup.n.01_1 nothing)"), "pddl-unknown-name"),
        (HOUSE.replace("FORMULA", "(ontop cup.n.01_1)"), "pddl-form"),
        (HOUSE.replace("- table.n.02 ", "- zeppelin.n.01 "), "unknown-category"),
        (BLOCKS_ON.replace("(:goal", "(:goal (on b a)) (:goal"), "pddl-form"),
        (BLOCKS_ON.replace("- block", "- block a - mug"), "pddl-form"),
        (BLOCKS_ON.replace("a b", "a b " + " ".join(f"c{k}" for k in range(199))), "pddl-too-many-things"),
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
