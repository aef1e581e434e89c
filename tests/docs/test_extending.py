"""Each row of docs/extending.md: what it says is enough, tried on a copy of the project.

The relation is in test_relations_page.py.
"""

import re

import pytest

from tests.docs.additions import PAGE, ROOT, copied, python, sections

SECTIONS = sections(PAGE.read_text())


def rows():
    """Name of a row -> the files and folders that it names."""
    table = re.findall(r"^\| an? ([^|]+) \| (.+) \|$", PAGE.read_text(), re.MULTILINE)
    return {name: re.findall(r"`([\w/.]+\.\w+)`", text) for name, text in table}


@pytest.fixture
def extended(tmp_path):
    """A copy of the project with the additions of a section."""

    def make(title):
        project = copied(tmp_path / "project")
        for addition in SECTIONS[title]:
            addition.make(project)
        return project

    (tmp_path / "project").mkdir()
    return make


def scenegen(project, *words):
    return python(project, "-m", "scenegen", *words)


def run_tests(project, *words):
    """Run tests of the copy; fails where none is chosen."""
    return python(project, "-m", "pytest", "-p", "no:cacheprovider", "-q", *words)


def test_every_row_has_a_section_and_names_what_there_is():
    found = rows()
    titles = re.findall(r"^## An? (.+)$", PAGE.read_text(), re.MULTILINE)
    assert sorted(found) == sorted(titles)
    for names in found.values():
        for name in names:
            assert (ROOT / name).exists() or "NAME" in name or "/" not in name, name


def test_every_section_touches_what_its_row_names():
    """And nothing else."""
    for title, additions in SECTIONS.items():
        _, _, row = title.partition(" ")
        named = [name for name in rows()[row] if "/" in name]
        for addition in additions:
            folder = addition.path.rpartition("/")[0]
            new = f"{folder}/NAME.py"
            linked = (
                "docs/curriculum.md",
                "docs/api.md",
                "docs/sampling.md",
                f"{folder}/registry.py",
            )  # the last is beside a file it names
            assert (new if addition.new else addition.path) in (*named, *linked), (title, addition.path)


@pytest.mark.long
def test_a_metric(extended):
    project = extended("A metric")
    program = """
import numpy as np
from scenegen.learn.evaluation.extent import extent

print(extent(np.array([[0.0], [0.0], [0.0], [2.0], [0.0], [0.0]])))
"""
    assert python(project, "-c", program) == "1.0\n"


@pytest.mark.slow
def test_all_additions_go_together_and_are_tidy(tmp_path):
    """ruff, over the files that are new or changed."""
    project = copied(tmp_path)
    additions = [addition for section in SECTIONS.values() for addition in section]
    for addition in additions:
        addition.make(project)
    touched = sorted({addition.path for addition in additions if addition.path.endswith(".py")})
    python(project, "-m", "ruff", "check", "--no-cache", *touched)
    python(project, "-m", "ruff", "format", "--no-cache", "--check", *touched)


@pytest.mark.slow
def test_a_primitive(extended):
    project = extended("A primitive")
    run_tests(project, "tests/geometry", "-k", "roughGap")
    (project / "my.spec").write_text("object fork, knife\ntask: roughGap(fork, knife) >= 10 cm\n")
    assert "roughGap(fork, knife)" in scenegen(project, "check", "my.spec")
    for method in ("rejection", "splitting"):
        scenegen(project, "sample", "my.spec", "--phi", "0:0.1", "-n", "4", "--method", method, "--out", "s.json")
    assert "roughGap" in scenegen(project, "eval", "my.spec", "s.json", "--explain")
    # what its traits promise: a node for the difference of both places, a mark in pictures, names in messages
    program = """
from scenegen.api.spec import parse
from scenegen.search.tape import make_tape
from scenegen.pictures.figures.dimensions import dimensions

checked = parse("object fork, knife\\ntask: roughGap(fork, knife) >= 10 cm").checked
tape = make_tape(checked.core, *checked.box())
(mark,) = dimensions(checked.core, checked.core.labels["task"], [0.25, 0.5, 0.0, 0.75, 0.5, 0.0])
print(len(tape.differences), mark.start, mark.end)
"""
    assert python(project, "-c", program) == "2 (0.25, 0.5) (0.75, 0.5)\n"
    (project / "my.spec").write_text("object fork, knife\ntask: roughGap(fork) >= 10 cm\n")
    with pytest.raises(AssertionError, match=r"roughGap\(one, other\)"):
        scenegen(project, "check", "my.spec")


@pytest.mark.slow
def test_an_object(extended):
    project = extended("An object")
    run_tests(project, "tests/things", "-k", "coaster")
    assert "coaster" in scenegen(project, "assets", "coaster")


@pytest.mark.slow
def test_a_shape(extended):
    project = extended("A shape")
    (project / "my.spec").write_text("object tile[2] = square(10 cm, 2 cm), mug\ntask: on(mug, tile[1])\n")
    scenegen(project, "check", "my.spec")
    scenegen(project, "fmt", "--check", "my.spec")
    scenegen(project, "sample", "my.spec", "--phi", "0:", "-n", "3", "--settle", "--out", "s.json")
    scenegen(project, "render", "s.json", "--out", "drawn", "--size", "64x48")
    scenegen(project, "export", "s.json", "--out", "s.xml")
    (project / "my.spec").write_text("object tile = square(10 cm, 2 cm, 3 cm)\ntask: x(tile) >= 0\n")
    with pytest.raises(AssertionError, match=r"square\(side, height\)"):
        scenegen(project, "check", "my.spec")


@pytest.mark.slow
def test_a_sampler(extended):
    project = extended("A sampler")
    goldens = ("tests/cli/test_help.py", "tests/cli/test_bad_requests.py", "-k", "sample or misspelt")
    run_tests(project, "--regenerate", *goldens)
    run_tests(project, *goldens)
    run_tests(project, "tests/sampling/engine/test_plans_travel.py", "-k", "new_process")
    request = ("sample", "first", "--phi", "0:0.2", "-n", "2000", "--method", "plain", "--timeout", "30")
    for workers in ("1", "2"):
        scenegen(project, *request, "--workers", workers, "--out", f"s{workers}.jsonl")
    assert (project / "s1.jsonl").read_bytes() == (project / "s2.jsonl").read_bytes()
    assert '"method":"plain"' in (project / "s1.jsonl").read_text().partition("\n")[0].replace(" ", "")


@pytest.mark.slow
def test_an_option_of_sample(extended):
    project = extended("An option of `sample`")
    goldens = ("tests/cli/test_help.py", "tests/api/test_request.py", "-k", "test_command and sample or request")
    run_tests(project, "--regenerate", *goldens)
    run_tests(project, *goldens)
    assert "--inset" in scenegen(project, "sample", "--help")
    assert "`--inset MARGIN`" in (project / "docs" / "sampling.md").read_text()
    words = ("sample", "first", "--phi", "0:0.2", "-n", "64", "--out", "s.json")
    lowest = "import scenegen; print(scenegen.read_scenes('s.json').phi['task'].min() >= 0.05)"
    scenegen(project, *words)
    assert python(project, "-c", lowest) == "False\n"
    scenegen(project, *words, "--inset", "0.05")
    assert python(project, "-c", lowest) == "True\n"
    python(project, "-c", "import scenegen; scenegen.sample(scenegen.load('specs/first.spec'), (0, 0.4), inset=0.1)")


@pytest.mark.slow
def test_a_figure(extended):
    project = extended("A figure")
    run_tests(project, "--regenerate", "tests/cli/test_help.py", "-k", "render")
    run_tests(project, "tests/cli/test_help.py", "-k", "render")
    scenegen(project, "sample", "first", "-n", "5", "--out", "s.json")
    scenegen(project, "render", "s.json", "--out", "drawn", "--figure", "marks")
    assert (project / "drawn" / "marks.svg").read_text().count("<path") == 5


@pytest.mark.slow
def test_a_model(extended):
    project = extended("A model")
    run_tests(project, "tests/learn/models/test_contract.py", "-k", "default-plain")
    run_tests(project, "--regenerate", "tests/cli/test_help.py", "-k", "train")
    run_tests(project, "tests/cli/test_help.py", "-k", "train")
    options = ("--model", "plain", "--epochs", "1", "--scenes", "512", "--hyper", "width=32", "--no-card")
    scenegen(project, "train", "first", *options, "--out", "m.safetensors")
    scenegen(project, "sample", "m.safetensors", "--phi", "0:0.1", "-n", "4", "--out", "s.json")


@pytest.mark.slow
def test_a_strategy(extended):
    project = extended("A strategy")
    run_tests(project, "tests/play/strategies/test_strategies.py", "-k", "in_turn")
    run_tests(project, "tests/play/strategies/test_strategies_help.py", "-k", "in_turn or judged")


@pytest.mark.slow
def test_a_command(extended):
    project = extended("A command")
    run_tests(project, "--regenerate", "tests/cli/test_help.py", "-k", "count or test_program")
    run_tests(project, "tests/cli/test_help.py", "-k", "count or test_program")
    scenegen(project, "sample", "first", "-n", "5", "--out", "s.json")
    assert scenegen(project, "count", "s.json") == "5\n"


@pytest.mark.slow
def test_a_file_format(extended):
    project = extended("A file format")
    run_tests(project, "tests/scenes/test_formats.py", "tests/cli/test_files.py", "-k", "ndjson")
    scenegen(project, "sample", "first", "-n", "5", "--out", "s.ndjson")
    scenegen(project, "export", "s.ndjson", "--out", "s.jsonl")
    run_tests(project, "--regenerate", "tests/cli/test_help.py", "-k", "export")
    run_tests(project, "tests/cli/test_help.py", "-k", "export")
    assert (project / "s.jsonl").read_bytes() == (project / "s.ndjson").read_bytes()


@pytest.mark.slow
def test_an_export_format(extended):
    project = extended("An export format")
    run_tests(project, "tests/worlds/export/test_worlds.py", "-k", "bodies or ending")
    scenegen(project, "sample", "first", "-n", "2", "--out", "s.json")
    scenegen(project, "export", "s.json", "--to", "bodies", "--out", "worlds")
    assert (project / "worlds" / "scene_0002.bodies").exists()


@pytest.mark.slow
def test_an_experiment(extended):
    project = extended("An experiment")
    run_tests(project, "tests/experiments/test_reports.py", "-k", "halves")
    python(project, "-m", "experiments", "halves", "--quick", "--out", "out")
    assert "| seed" in (project / "out" / "halves.md").read_text()
