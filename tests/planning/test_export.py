"""Scenes as PDDL problems: facts are what `eval` says, and the goal holds in `:init` where its phi is 0 or more."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import scenegen
from scenegen.api.scene_arrays import make_header
from scenegen.api.scenes import SceneSet, evaluate
from scenegen.errors import ScenegenError, Source
from scenegen.lang.checker import check_text
from scenegen.planning.conversion import export_problems
from scenegen.planning.export import SpecProblems, goal_labels, goal_notes, vocabulary
from scenegen.planning.facts import ground
from scenegen.planning.problem import Domain, expressions, problem_of
from scenegen.pose import as_poses
from scenegen.scenes.data import RequestData

SPECS = Path(__file__).parents[2] / "specs"
ROW = "object block[3] = box(4 cm, 4 cm, 4 cm)\nobject mug\nregion zone = rect(0, 0, 0.5, 0.5)\n"
GOALS = """def beside(a, b) = gap(a, b) <= 5 cm
task: (forall p, q in consecutive(block): leftOf(p, q)) & !(beside(mug, block[1]) | x(mug) >= 0.4)
goal: inside(mug, zone) -> closeTo(mug, block[2], 30 cm) & angle(mug, 90 deg, 45 deg)
"""


def random_scenes(text: str, count: int, seed: int) -> SceneSet:
    """Poses uniform over the workspace, which nothing has to hold for."""
    spec = check_text(text)
    low, high = spec.box()
    rows = low[:, None] + (high - low)[:, None] * np.random.default_rng(seed).random((len(low), count))
    return SceneSet(as_poses(rows), {}, make_header(spec, {}, RequestData(phi={}, n=count)))


def facts_of(text: str) -> set[tuple[str, ...]]:
    """The initial facts of a problem, by our own reader."""
    source = Source("p.pddl", text)
    found = problem_of(source, expressions(source), Domain())
    return {tuple(one.span.text for one in fact.items) for fact in found.init}  # type: ignore[union-attr]


def told(scenes: SceneSet, statements: list[str]) -> dict[str, np.ndarray]:
    """What `eval` says of statements, each as a label of its own."""
    source = scenes.header.spec.source
    far = f"x({scenes.objects[0]}) <= 99 m"  # holds, and keeps what is the same in every scene from being refused
    labels = "".join(f"fact{number}_: ({one}) & {far}\n" for number, one in enumerate(statements))
    phi = evaluate(check_text(source + labels), scenes)
    return {one: phi[f"fact{number}_"] >= 0.0 for number, one in enumerate(statements)}


def problems_of(scenes: SceneSet, **choice: list[str] | None) -> tuple[SpecProblems, list[str]]:
    from scenegen.api.scene_arrays import rows_of

    grounded = ground(scenes.header.spec.source, "scenes", choice.get("facts"))
    problems = SpecProblems(grounded, goal_labels(grounded, choice.get("goal")), vocabulary([grounded]))
    comments = dict.fromkeys(range(1, len(scenes) + 1), "")
    return problems, list(problems.of_scenes(rows_of(grounded.spec, scenes), comments))


@pytest.mark.long
def test_facts_are_those_that_eval_says_hold() -> None:
    scenes = random_scenes(ROW + GOALS, 20, 1)
    problems, texts = problems_of(scenes)
    facts = problems.grounded.facts
    some = {"mug", "block[2]", "zone"}  # all would take seconds
    plain = [one for one in facts if one.arguments and "-" not in one.predicate and some.issuperset(one.arguments)]
    said = {one: f"{one.predicate}({', '.join(one.arguments)})" for one in plain}
    holds = told(scenes, list(said.values()))
    written = [facts_of(text) for text in texts]
    for fact, text in said.items():
        name = problems.words.fact(fact)
        found = np.array([tuple(name[1:-1].split()) in one for one in written])
        assert (found == holds[text]).all(), text
    assert len(said) > 80
    for label, phi in evaluate(check_text(scenes.header.spec.source), scenes).items():
        assert [(label,) in one for one in written] == (phi >= 0.0).tolist()


def test_the_goal_is_written_in_the_relations_of_the_label() -> None:
    problems, texts = problems_of(random_scenes(ROW + GOALS, 1, 1), goal=["task"], facts=["touching"])
    assert texts[0].split("(:goal ")[1] == (
        "(and\n    (and (leftOf block_1 block_2) (leftOf block_2 block_3))\n"
        "    (and (not (beside mug block_1)) (part-1)))))\n"
    )
    assert "(part-1) ; !(x(mug) >= 0.4)" in problems.domain
    assert [one.title for one in goal_notes([problems])] == [
        "what is no relation of things in the goal is a predicate by number: part-1 is `!(x(mug) >= 0.4)`"
    ]
    assert "(touching ?a - thing ?b - thing) ; a and b touch" in problems.domain
    _, texts = problems_of(random_scenes(ROW + GOALS, 1, 1), facts=[])
    assert "(or\n" in texts[0] or "(or (not (inside mug zone))" in texts[0]
    assert "(closeTo-30cm mug block_2) (angle-90deg-45deg mug)" in texts[0]


def test_the_goal_holds_where_phi_of_its_label_is_0_or_more() -> None:
    scenes = random_scenes(ROW + GOALS, 300, 2)
    for label in ("task", "goal"):
        problems, texts = problems_of(scenes, goal=[label], facts=[])
        assert len(texts) == 300
        assert problems.edge == 0


def test_a_margin_of_exactly_0_is_told() -> None:
    text = "object a at (0.2, 0.2)\nobject b at (0.2, 0.5)\nobject c\ntask: !leftOf(a, b) & leftOf(c, a)\n"
    problems, _ = problems_of(random_scenes(text, 30, 3))
    assert [one.code for one in goal_notes([problems])] in ([], ["pddl-goal"])


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("object Mug, mug, define, and_\ntask: leftOf(Mug, mug) & leftOf(define, and_)\n", "Mug mug-2 define-2 and_"),
        (
            "object task_, mug[2]\nobject mug_1\ntask: leftOf(mug[1], mug_1) & leftOf(task_, mug[2])\n",
            "task_ task mug_1 mug_1-2 mug_2",
        ),
    ],
)
def test_names_are_those_of_pddl(text: str, names: str) -> None:
    problems, _ = problems_of(random_scenes(text, 1, 0), facts=[])
    made = [*problems.words.things.values(), *problems.words.predicates.values()]
    assert set(names.split()) <= set(made)
    assert len({one.lower() for one in made}) == len(made)


def test_files(tmp_path: Path) -> None:
    scenes = random_scenes(ROW + GOALS, 3, 1)
    made = export_problems(scenes, tmp_path / "out", facts=["leftOf"])
    assert [one.name for one in made.problems] == ["scene_0001.pddl", "scene_0002.pddl", "scene_0003.pddl"]
    assert made.domain == tmp_path / "out" / "domain.pddl"
    one = scenes[:1].export(tmp_path / "one.pddl")
    assert one == (tmp_path / "one.pddl",)
    assert (tmp_path / "one_domain.pddl").is_file()


DRAWN = """object block[1..3] = box(4 cm, 4 cm, 4 cm)
object mug
goal: (forall b in block: leftOf(b, mug)) & x(block.last) <= 0.4 & gap(block[1], mug) <= 20 cm
"""


@pytest.mark.long
def test_scenes_of_one_spec_may_have_more_things_than_others(tmp_path: Path) -> None:
    scenes = scenegen.sample(scenegen.parse(DRAWN), {"goal": (-0.1, 0.1)}, n=12, seed=4)
    made = export_problems(scenes, tmp_path / "out", facts=["leftOf"])
    assert len(set(scenes.counts["block"].tolist())) == 3
    domain = (tmp_path / "out" / "domain.pddl").read_text()
    parts = dict(re.findall(r"\((part-\d)\) ; (.*)", domain))
    assert sorted(parts.values()) == ["gap(block[1], mug) <= 0.2", *(f"x(block[{one}]) <= 0.4" for one in (1, 2, 3))]
    names = {said: name for name, said in parts.items()}
    for number, file in enumerate(made.problems):
        text = file.read_text()
        blocks = [f"block_{one + 1}" for one in range(scenes.counts["block"][number])]
        assert [
            one.split()[0] for one in text.split("(:objects")[1].split(")")[0].splitlines() if "box" in one
        ] == blocks
        assert text.split("(:goal ")[1].count("leftOf") == len(blocks)
        facts = facts_of(text)
        assert (("goal",) in facts) == (scenes.phi["goal"][number] >= 0.0)
        x = {
            one.replace("[", "_").replace("]", ""): place
            for one, place in zip(scenes.objects, scenes.poses[number, :, 0], strict=True)
        }
        assert {one for one in facts if one[0] == "leftOf"} == {
            ("leftOf", a, b) for a in x for b in x if a != b and x[a] < x[b]
        }
        last = names[f"x(block[{len(blocks)}]) <= 0.4"]
        assert ((last,) in facts) == (x[blocks[-1]] <= 0.4)
        assert f"({last})" in text.split("(:goal ")[1]


def test_predicates_of_a_map(tmp_path: Path) -> None:
    table = tmp_path / "map.toml"
    table.write_text(
        '[predicates]\nstacked-on = "on"\nnext = "gap($1, $2) <= 5 cm"\nin-zone = "inside($1, $2)"\nhot = "none"\n'
    )
    made = export_problems(random_scenes(ROW + GOALS, 2, 1), tmp_path / "out", table=table, goal=["task"])
    domain = (tmp_path / "out" / "domain.pddl").read_text()
    assert made.domain is not None
    assert "(in-zone ?a - thing ?b - object)" in domain
    assert "(next ?a - thing ?b - object)" in domain
    assert "touching" not in domain and "hot" not in domain
    assert "(not (next mug block_1))" in made.problems[0].read_text()


@pytest.mark.parametrize(
    ("options", "code"),
    [
        ({"facts": ["leftof"]}, "unknown-choice"),
        ({"goal": ["tusk"]}, "unknown-choice"),
        ({"table": '[predicates]\nfoo = "leftFo($1, $2)"\n'}, "facts-mean-nothing"),
        ({"table": '[predicates]\nfoo = "leftOf($1, $2"\n'}, "facts-mean-nothing"),
        ({"table": "[predicates]\nfoo = 3\n"}, "bad-map"),
        ({"table": '[predicates]\nfoo = "leftOf($1, $2)"\n', "facts": ["leftOf"]}, "unknown-choice"),
        ({"out": "file.pddl"}, "one-problem-a-file"),
        ({"whole_goal": True}, "out-of-place"),
        ({"out": "file.xml"}, "ending-of-another"),
    ],
)
def test_a_bad_request_is_one_diagnostic(tmp_path: Path, options: dict[str, object], code: str) -> None:
    if "table" in options:
        (tmp_path / "map.toml").write_text(str(options["table"]))
        options = {**options, "table": tmp_path / "map.toml"}
    out = tmp_path / str(options.get("out", "out"))
    rest = {name: value for name, value in options.items() if name != "out"}
    with pytest.raises(ScenegenError) as raised:
        export_problems(random_scenes(ROW + GOALS, 2, 1), out, **rest)  # type: ignore[arg-type]
    assert [one.code for one in raised.value.diagnostics] == [code]
    assert not out.exists()


@pytest.mark.long
def test_too_many_facts_are_refused() -> None:
    text = "object a[60]\ntask: leftOf(a[1], a[2])\n"
    with pytest.raises(ScenegenError) as raised:
        ground(text, "many")
    assert [one.code for one in raised.value.diagnostics] == ["pddl-too-large"]
    assert len(ground(text, "many", ["between"][:0]).facts) == 1 + 60 * 59


@pytest.mark.long
def test_pairs_have_the_facts_of_both_ends(tmp_path: Path) -> None:
    spec = scenegen.parse(
        "object mug, plate, knife\ntask: leftOf(mug, plate) & (closeTo(knife, plate) | leftOf(knife, mug))"
    )
    pairs = scenegen.pairs(spec, n=4, seed=1)
    made = export_problems(pairs, tmp_path / "some", facts=["leftOf"])
    whole = export_problems(pairs, tmp_path / "whole", facts=["leftOf"], whole_goal=True)
    for number, (one, other) in enumerate(zip(made.problems, whole.problems, strict=True)):
        goal = one.read_text().split("(:goal ")[1]
        assert "(leftOf mug plate)" in goal and "(or" not in goal
        said = told(pairs.scenes(-1), ["leftOf(knife, mug)", "closeTo(knife, plate)"])
        assert ("(leftOf knife mug)" in goal) == said["leftOf(knife, mug)"][number]
        assert ("(closeTo knife plate)" in goal) == said["closeTo(knife, plate)"][number]
        start = told(pairs.scenes(0), ["leftOf(mug, knife)"])["leftOf(mug, knife)"][number]
        assert (("leftOf", "mug", "knife") in facts_of(one.read_text())) == start
        everything = other.read_text().split("(:goal ")[1]
        assert "(task)" in everything
        end = told(pairs.scenes(-1), ["leftOf(mug, knife)"])["leftOf(mug, knife)"][number]
        assert ("(leftOf mug knife)" in everything) == end


def test_motions_over_time_are_starts_and_goals(tmp_path: Path) -> None:
    spec = scenegen.parse(
        "time 3 steps\nobject mug, plate\nrequire speed(mug) <= 1 m/s & speed(plate) <= 1 m/s\n"
        "task: finally leftOf(mug, plate)\n"
    )
    motions = scenegen.sample_motions(spec, {"task": (0.0, None)}, n=2, seed=0)
    made = export_problems(motions, tmp_path / "out", facts=["leftOf", "rightOf"])
    assert "(leftOf mug plate)" in made.problems[0].read_text().split("(:goal ")[1]
    assert [one.code for one in made.warnings] == ["pddl-goal"]
    for scenes, goal, code in ((motions.scenes(0), None, "no-goal-over-time"), (motions, ["task"], "out-of-place")):
        with pytest.raises(ScenegenError) as raised:
            export_problems(scenes, tmp_path / "scenes", goal=goal)
        assert [one.code for one in raised.value.diagnostics] == [code]


Reader = Callable[[Path, Path], object]


@pytest.mark.long
@pytest.mark.parametrize("name", ["table_setting", "sort_7_quantified", "packing_tray"])
def test_a_planners_parser_reads_them(name: str, tmp_path: Path) -> None:
    """unified-planning's PDDL reader finds the facts that `eval` says hold, and its simulation of the initial state
    decides the goal as phi does."""
    pytest.importorskip("unified_planning")
    from unified_planning.engines.sequential_simulator import UPSequentialSimulator
    from unified_planning.io import PDDLReader
    from unified_planning.shortcuts import get_environment

    get_environment().credits_stream = None
    scenes = random_scenes(scenegen.load(SPECS / f"{name}.spec").source, 3, 5)
    for label in check_text(scenes.header.spec.source).labels:
        made = export_problems(scenes, tmp_path / label, facts=["leftOf", "closeTo", "touching"], goal=[label])
        wanted = evaluate(check_text(scenes.header.spec.source), scenes)[label] >= 0.0
        pairs = [(a, b) for a in scenes.objects for b in scenes.objects if a != b]
        said = [f"{relation}({a}, {b})" for relation in ("leftOf", "closeTo", "touching") for a, b in pairs]
        holds = told(scenes, said)
        for number, file in enumerate(made.problems):
            problem = PDDLReader().parse_problem(str(made.domain), str(file))
            values = problem.explicit_initial_values
            found = {f"{key}".replace(" ", "") for key, value in values.items() if value.is_true()}
            for one in said:
                known = one.lower().replace("[", "_").replace("]", "").replace(" ", "")
                assert (known in found) == holds[one][number], one
            with UPSequentialSimulator(problem, error_on_failed_checks=False) as simulator:
                assert simulator.is_goal(simulator.get_initial_state()) == wanted[number]
