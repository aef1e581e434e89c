"""Help that teaches: what the program says of itself, held still."""

import pytest

from scenegen.api.figures import FIGURES
from scenegen.cli.app import ALONE, COMMANDS


def test_program(scenegen, golden):
    outcome = scenegen("--help")
    assert (outcome.status, outcome.err) == (0, "")
    golden("cli/help/scenegen.txt", _trimmed(outcome.out))


@pytest.mark.parametrize("command", COMMANDS)
def test_command(command, scenegen, golden):
    outcome = scenegen(command, "--help")
    assert (outcome.status, outcome.err) == (0, "")
    assert outcome.out.count(f"  scenegen {command} ") >= 2, "help teaches by example"
    golden(f"cli/help/{command}.txt", _trimmed(outcome.out))


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_examples_fit_a_narrow_terminal(command, scenegen, monkeypatch):
    wide = scenegen(*command.split(), "--help").out
    monkeypatch.setenv("COLUMNS", "80")
    narrow = scenegen(*command.split(), "--help").out
    examples = [line.rstrip() for line in wide.splitlines() if line.startswith("   ")]
    assert examples and set(examples) <= {line.rstrip() for line in narrow.splitlines()}


@pytest.mark.parametrize("command", ["", *(one for one in COMMANDS if one not in ALONE)])
def test_a_bare_command_shows_its_help_to_people_not_to_pipes(command, scenegen):
    outcome = scenegen(*command.split())
    assert (outcome.status, outcome.out) == (2, "")
    assert outcome.err == scenegen(*command.split(), "--help").out


def test_the_help_of_render_names_every_figure(scenegen):
    told = scenegen("render", "--help").out
    assert all(f"  {name} " in told for name in FIGURES)


def test_version(scenegen):
    import scenegen as package

    outcome = scenegen("--version")
    assert (outcome.status, outcome.out, outcome.err) == (0, f"{package.__version__}\n", "")


def test_the_installed_program_says_the_same(process, scenegen):
    done = process("sample", "--help")
    assert (done.returncode, done.stdout) == (0, scenegen("sample", "--help").out)


def _trimmed(text):
    return "\n".join(line.rstrip() for line in text.splitlines()) + "\n"
