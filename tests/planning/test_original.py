"""Scenes of imported problems in the problem's own words: facts are what `eval` says, the goal holds where phi does."""

from pathlib import Path

import numpy as np
import pytest

import scenegen
from scenegen.api.scenes import SceneSet, evaluate
from scenegen.errors import ScenegenError, Source
from scenegen.planning.export import _goal
from scenegen.planning.facts import truth_of
from scenegen.planning.problem import Domain, expressions, problem_of
from tests.planning.test_import import HOUSE, KITCHEN

DOMAIN = """(define (domain blocks) (:requirements :typing :action-costs :adl) (:types block bowl)
  (:predicates (on ?x ?y - block) (clear ?x - block) (on-table ?x - block) (handempty) (left-of ?x ?y - block))
  (:functions (total-cost) - number)
  (:action lift :parameters (?x - block) :precondition (and (clear ?x) (on-table ?x)) :effect (not (on-table ?x))))
"""
BLOCKS = """(define (problem tower) (:domain blocks)
  (:objects a b c - block) ; three
  (:init (handempty) (clear a) (on-table a) (clear b) (on-table b) (clear c) (on-table c) (= (total-cost) 0))
  (:goal FORMULA) (:metric minimize (total-cost)))
"""
FORMULAS = [
    "(and (on a b) (on-table c))",
    "(and (on a b) (forall (?x - block) (imply (on ?x b) (clear ?x))))",
    "(exists (?x ?y - block) (and (on ?x ?y) (not (on-table ?x))))",
    "(or (left-of a b) (not (clear c)))",
]


def scenes_of(folder: Path, text: str, domain: str, count: int) -> tuple[SceneSet, dict[str, Path]]:
    """Scenes of the imported spec, half of which meet the goal, and the files of the problem."""
    files = {"problem": folder / "task.bddl"}
    files["problem"].write_text(text)
    if domain:
        files["domain"] = folder / "domain.pddl"
        files["domain"].write_text(domain)
    spec = scenegen.parse(scenegen.import_problem(**files).text)
    ends = [(0.0, None), (None, 0.0)]
    parts = [scenegen.sample(spec, {"goal": one}, n=count, seed=3, keep_partial=True, timeout=20) for one in ends]
    poses, on = np.concatenate([one.poses for one in parts]), [one.on for one in parts]
    joined = None if on[0] is None else np.concatenate([one for one in on if one is not None])
    return SceneSet(poses, {}, parts[0].header, on=joined), files


def agree(folder: Path, text: str, domain: str = "", count: int = 4) -> list[Path]:
    """The files, after the goal was decided from the facts that they hold, and facts were held against `eval`."""
    scenes, files = scenes_of(folder, text, domain, count)
    made = scenegen.export_problems(scenes, folder / "out", **files)
    wanted = evaluate(scenegen.parse(scenes.header.spec.source).checked, scenes)["goal"] >= 0.0
    reading = scenegen.import_problem(**files).reading
    goal, atoms = _goal(reading)
    for number, file in enumerate(made.problems):
        source = Source("p", file.read_text())
        init = problem_of(source, expressions(source), Domain()).init
        facts = {tuple(one.span.text for one in fact.items) for fact in init}  # type: ignore[union-attr]
        written = [(name, *(one.replace(".", "_") for one in names)) in facts for name, names in atoms]
        assert truth_of(goal, np.array(written)[:, None])[0] == wanted[number]
        formulas = [one for one in reading.formulas.items() if one[1] != "false"]
        source_text = scenes.header.spec.source
        far = f"x({scenes.objects[0]}) <= 99 m"
        labels = "".join(f"fact{at}_: ({one}) & {far}\n" for at, (_, one) in enumerate(formulas))
        phi = evaluate(scenegen.parse(source_text + labels).checked, scenes[number : number + 1])
        for at, ((name, names), _) in enumerate(formulas):
            found = (name, *(one.replace(".", "_") for one in names)) in facts
            assert found == (phi[f"fact{at}_"][0] >= 0.0), (name, names)
    assert wanted.any() and not wanted.all()
    return list(made.problems)


@pytest.mark.long
def test_blocks_keep_their_text(tmp_path: Path) -> None:
    files = agree(tmp_path, BLOCKS.replace("FORMULA", FORMULAS[0]), DOMAIN, 2)
    assert not (tmp_path / "out" / "domain.pddl").exists()
    text = files[0].read_text()
    assert "(:objects a b c - block)" in text and "(:metric minimize (total-cost))" in text
    assert "(handempty)\n" in text and "(= (total-cost) 0)\n" in text
    assert "(define (problem tower-1)" in text


@pytest.mark.long
def test_a_libero_problem_is_written_out(tmp_path: Path) -> None:
    text = KITCHEN.replace("GOAL", "plate_1").replace("(Turnon flat_stove_1)", "(Not (On plate_1 flat_stove_1))")
    files = agree(tmp_path, text, count=1)
    assert "(On flat_stove_1 kitchen_table_stove_place)" in files[0].read_text()
    assert "(On ?a - object ?b - object)" in (tmp_path / "out" / "domain.pddl").read_text()


@pytest.mark.long
@pytest.mark.parametrize(
    "formula",
    [
        *FORMULAS,
        "(and (ON A b) (forall (?X - BLOCK) (imply (= ?x C) (on-table ?X))))",
        "(exists (?x - (either block bowl)) (and (on ?x b) (not (= ?x c))))",
    ],
)
def test_every_kind_of_goal(tmp_path: Path, formula: str) -> None:
    agree(tmp_path, BLOCKS.replace("FORMULA", formula), DOMAIN)


@pytest.mark.long
@pytest.mark.parametrize(
    "formula",
    [
        "(forall (?c - cup.n.01) (ontop ?c ?table.n.02_1))",
        "(forn (1) (?c - cup.n.01) (ontop ?c table.n.02_1))",
        "(and (nextto cup.n.01_1 cup.n.01_2) (not (touching cup.n.01_1 cup.n.01_2)))",
        "(forpairs (?c - cup.n.01) (?d - cup.n.01) (nextto ?c ?d))",
        "(forall (?c - cup.n.01) (or (ontop ?c table.n.02_1) (nextto ?c cup.n.01_2)))",
    ],
)
def test_houses(tmp_path: Path, formula: str) -> None:
    agree(tmp_path, HOUSE.replace("FORMULA", formula))


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "domain"),
    [
        *((BLOCKS.replace("FORMULA", one), DOMAIN) for one in FORMULAS[:2]),
        (HOUSE.replace("FORMULA", "(forn (1) (?c - cup.n.01) (ontop ?c table.n.02_1))"), ""),
        (KITCHEN.replace("GOAL", "plate_1").replace("(Turnon flat_stove_1)", "(On plate_1 kitchen_table)"), ""),
    ],
)
def test_a_planners_parser_reads_them(text: str, domain: str, tmp_path: Path) -> None:
    """unified-planning, with the problem's own domain where it has one, decides the goal as phi does."""
    pytest.importorskip("unified_planning")
    from unified_planning.engines.sequential_simulator import UPSequentialSimulator
    from unified_planning.io import PDDLReader
    from unified_planning.shortcuts import get_environment

    get_environment().credits_stream = None
    scenes, files = scenes_of(tmp_path, text, domain, 3)
    made = scenegen.export_problems(scenes, tmp_path / "out", **files)
    wanted = evaluate(scenegen.parse(scenes.header.spec.source).checked, scenes)["goal"] >= 0.0
    for number, file in enumerate(made.problems):
        problem = PDDLReader().parse_problem(str(made.domain or files["domain"]), str(file))
        with UPSequentialSimulator(problem, error_on_failed_checks=False) as simulator:
            assert simulator.is_goal(simulator.get_initial_state()) == wanted[number]


@pytest.mark.long
def test_the_floor_of_onfloor_is_no_cup_and_what_no_scene_decides_is_told(tmp_path: Path) -> None:
    either = "(or (onfloor cup.n.01_1 floor.n.01_1) (ontop cup.n.01_2 table.n.02_1))"
    formula = f"(and (ontop cup.n.01_1 table.n.02_1) (cooked cup.n.01_2) {either})"
    (tmp_path / "p.bddl").write_text(HOUSE.replace("FORMULA", formula))
    spec = scenegen.parse(scenegen.import_problem(tmp_path / "p.bddl").text)
    scenes = scenegen.sample(spec, n=1, seed=1)
    made = scenegen.export_problems(scenes, tmp_path / "out", problem=tmp_path / "p.bddl")
    assert "(onfloor cup_n_01_2 cup" not in made.problems[0].read_text()
    assert "(cooked cup_n_01_2)" in made.problems[0].read_text().split("(:goal")[1]
    assert [one.code for one in made.warnings] == ["pddl-goal"]
    made = scenegen.export_problems(scenes, tmp_path / "own", facts=[])
    assert made.domain is not None
    assert ", of cup_1\n" in made.domain.read_text()


def test_scenes_of_another_problem_are_refused(tmp_path: Path) -> None:
    (tmp_path / "p.pddl").write_text(BLOCKS.replace("FORMULA", FORMULAS[0]))
    scenes = scenegen.sample(scenegen.parse("leftOf(mug, plate)"), n=1)
    for options, code in (({}, "not-its-scenes"), ({"goal": ["task"]}, "out-of-place")):
        with pytest.raises(ScenegenError) as raised:
            scenegen.export_problems(scenes, tmp_path / "out", problem=tmp_path / "p.pddl", **options)  # type: ignore[arg-type]
        assert [one.code for one in raised.value.diagnostics] == [code]


@pytest.mark.long
def test_what_of_a_goal_is_no_fact_stays_and_is_told(tmp_path: Path) -> None:
    formula = "(and (on a b) (<= (weight a) 10) (preference p1 (on b c)))"
    scenes, files = scenes_of(tmp_path, BLOCKS.replace("FORMULA", formula), DOMAIN, 1)
    made = scenegen.export_problems(scenes, tmp_path / "out", **files)
    assert formula in made.problems[0].read_text()
    (note,) = made.warnings
    assert note.code == "pddl-goal" and "(preference p1 (on b c))" in note.title
