"""Help that teaches: what the program says of itself, held still. Colours on a terminal, plain text in a pipe, and the
two variables by which people overrule either. Specs by name: those that ship, those in the current folder, and one
to start from.
"""

import json
import os
import pty
import re
import subprocess
import sys

import pytest

from scenegen.cli.app import COMMANDS, WITHOUT_ARGUMENTS, run
from scenegen.pictures.scenes import FIGURES


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


@pytest.mark.parametrize("command", ["", *(one for one in COMMANDS if one not in WITHOUT_ARGUMENTS)])
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
    assert scenegen("explain", "visible").out.startswith("visible(a, camera")  # a relation comes first
    assert "unhidden(a, front)" in scenegen("explain", "occluded").out  # a word of another language
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


BAD = "object mug, plate\ntask: leftOf(mug plate)\nsafe: leftOf(mug,\n"
ESCAPE = re.compile(r"\x1b\[[\d;]*m")


@pytest.fixture
def bad(tmp_path, monkeypatch):
    """A spec with two mistakes, in a terminal whose variables say nothing about colours."""
    (tmp_path / "bad.spec").write_text(BAD)
    for name in ("NO_COLOR", "FORCE_COLOR"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("TERM", "xterm")
    return tmp_path / "bad.spec"


@pytest.fixture
def terminal():
    """The two sides of a pseudo-terminal: what the first reads is written to the second."""
    ours, theirs = pty.openpty()
    yield ours, theirs
    os.close(ours)


def everything(ours, theirs):
    """What was written, once the other side is closed."""
    os.close(theirs)
    said = b""
    while chunk := _read(ours):
        said += chunk
    return said.decode().replace("\r\n", "\n")


def _read(handle):
    try:
        return os.read(handle, 65536)
    except OSError:  # how Linux says that the other side of a terminal is gone
        return b""


@pytest.mark.parametrize(
    ("on_terminal", "variables", "colored"),
    [
        (True, {}, True),
        (False, {}, False),
        (True, {"NO_COLOR": "1"}, False),
        (True, {"NO_COLOR": ""}, True),
        (True, {"TERM": "dumb"}, False),
        (False, {"FORCE_COLOR": "1"}, True),
        (True, {"FORCE_COLOR": "1", "NO_COLOR": "1"}, False),
    ],
)
def test_colors(bad, terminal, monkeypatch, capfd, on_terminal, variables, colored):
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    if on_terminal:
        with monkeypatch.context() as patch, open(terminal[1], "w", closefd=False) as stderr:
            patch.setattr(sys, "stderr", stderr)
            status = run(["check", str(bad)])
        said = everything(*terminal)
    else:
        status = run(["check", str(bad)])
        said = capfd.readouterr().err
        os.close(terminal[1])
    assert status == 1 and ("\x1b[1;31merror" in said) == bool(ESCAPE.search(said)) == colored
    assert ESCAPE.sub("", said).count("error[") == 2


@pytest.mark.long
def test_the_program_itself_on_a_terminal(bad, terminal):
    command = [sys.executable, "-m", "scenegen", "check", str(bad)]
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=terminal[1], timeout=60)
    said = everything(*terminal)
    assert (done.returncode, done.stdout) == (1, b"") and "\x1b[1;31merror" in said


def test_every_shipped_spec_is_listed_with_a_line(scenegen, root):
    lines = scenegen("specs").out.splitlines()
    names = [path.stem for path in sorted((root / "specs").glob("*.spec"))]
    assert [line.split()[0] for line in lines] == names
    assert all(len(line.split(maxsplit=1)[1]) > 20 for line in lines)


def test_the_text_of_one(scenegen, root):
    assert scenegen("specs", "first").out == (root / "specs" / "first.spec").read_text()


def test_a_name_that_none_has(refused):
    assert "did you mean `first`" in refused("specs", "frist")


def test_a_shipped_spec_by_its_name(scenegen, here):
    outcome = scenegen("check", "table_setting")
    assert outcome.status == 0 and outcome.out.startswith("table_setting: ok\n  A table set for one")
    outcome = scenegen("sample", "first", "--phi", "0:0.2", "-n", "2", "--out", "s.json")
    assert outcome.status == 0
    assert scenegen("eval", "first", "s.json", "--json").status == 0


@pytest.mark.parametrize("name", ["first", "first.spec"])
def test_a_file_of_that_name_comes_first(scenegen, here, name):
    (here / name).write_text("# my own\ntask: leftOf(fork, spoon)\n")
    assert "my own" in scenegen("check", "first").out


def test_an_ending_may_be_left_out(scenegen, here):
    assert scenegen("check", "good").out.startswith("good.spec: ok\n")


def test_a_name_of_nothing(refused):
    said = refused("check", "table_seting")
    assert "no file table_seting, nor table_seting.spec" in said and "did you mean `table_setting`, which ships" in said
    assert "`scenegen specs` lists" in refused("range", "nothing_like_it")


def test_no_shipped_spec_is_rewritten(refused, root):
    assert "cannot read first" in refused("fmt", "first")


def test_new_writes_a_spec_that_works(scenegen, here):
    outcome = scenegen("new", "mine")
    assert (outcome.status, outcome.out) == (0, "") and "scenegen check mine.spec" in outcome.err
    text = (here / "mine.spec").read_text()
    assert text.count("#") >= 8
    outcome = scenegen("check", "mine.spec")
    assert (outcome.status, outcome.err) == (0, "")
    assert scenegen("fmt", "--check", "mine.spec").status == 0, "it is in canonical form"
    outcome = scenegen("sample", "mine.spec", "--satisfied", "-n", "4", "--out", "s.json")
    assert outcome.status == 0 and len(json.loads((here / "s.json").read_text())["scenes"]) == 4


@pytest.mark.parametrize("name", ["good", "good.spec", "dangling"])
def test_new_overwrites_nothing(refused, here, name):
    (here / "dangling.spec").symlink_to(here / "elsewhere")
    assert "is there already" in refused("new", name)


def test_new_where_there_is_no_folder(refused):
    assert "cannot write nowhere/mine.spec" in refused("new", "nowhere/mine")


def test_the_help_of_sample_needs_no_arrays():
    program = (
        "import sys; from scenegen.cli.app import run; run(['sample', '--help']); sys.exit('numpy' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stderr) == (0, "")
