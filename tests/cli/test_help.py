"""Help that teaches: what the program says of itself, held still."""

import pytest

from scenegen.cli.app import ALONE, COMMANDS
from scenegen.show.scenes import FIGURES


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


def test_relations_in_the_terminal(scenegen):
    """All of them, one, and what another language calls them; `explain` shows the same."""
    from scenegen.lang.check.scope import groups, signatures

    listed = scenegen("relations").out
    for usage in (
        *(one.usage for group in groups() for one in group.entries),
        *(one.usage for one in signatures().values()),
    ):
        assert f"  {usage}\n" in listed
    one = scenegen("relations", "closeTo").out
    assert "def closeTo(a, b, e = EPS_CLOSE) = dist(a, b) <= e" in one and "EPS_CLOSE = 25 cm" in one
    assert "at most e apart" in one and one == scenegen("explain", "closeTo").out
    assert scenegen("relations", "gap").out.startswith("gap(a, b)\n")
    missing = scenegen("relations", "near")
    assert (missing.status, missing.out) == (1, "") and "write closeTo(a, b, 20 cm)" in missing.err


def test_words_and_pages_are_explained(scenegen):
    assert "draw masks" in scenegen("explain", "visible").out
    assert scenegen("explain", "not-here").out.startswith("# What the language cannot say")
    assert scenegen("explain", "neither").status == 1


def test_texts_of_the_program_point_to_nothing_that_an_installation_lacks(root):
    """What a message calls a page, `scenegen explain` prints, and the wheel carries it."""
    import tomllib

    from scenegen.errors.catalog import catalog
    from scenegen.resources import PAGES, shipped_pages

    assert set(shipped_pages()) == set(PAGES)
    build = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["hatch"]["build"]["targets"]["wheel"]
    assert {f"docs/{page}.md": f"scenegen/_data/docs/{page}.md" for page in PAGES}.items() <= build[
        "force-include"
    ].items()
    for entry in catalog().values():
        texts = [
            *(str(text) for text in (entry.kind.title, entry.kind.label, entry.kind.help, entry.kind.note)),
            entry.means,
        ]
        assert "docs/" not in " ".join(texts), entry.kind.code
