"""Every code block of the README and the docs is run: commands, programs and specs alike.

`spec` blocks must pass the checker (`spec file=NAME` also writes them for later blocks of the page); `sh` blocks run
line by line; `console` blocks are run by a shell and their output compared; `python` blocks are executed, with
`needs=PACKAGE` only where that is installed: elsewhere the page's test runs the rest, and is reported as skipped;
`toml` blocks must be TOML. The blocks of a page share a folder that holds `specs` and `examples`. `golden` blocks are
put to work by test_relations_page.py; `text` is not run. Links between pages must lead somewhere.
"""

import os
import re
import shlex
import subprocess
import sys
import tomllib
from importlib.util import find_spec
from pathlib import Path

import pytest

from scenegen.lang.checker import check_text

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("scenegen", "experiments", "benchmarks", "tests", "docs", "examples")
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(\w*)[ ]*([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def name_of(page):
    return str(page.relative_to(ROOT))


PATH = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
PLAIN = {"PATH": PATH, "NO_COLOR": "1", "TERM": "dumb", "COLUMNS": "100"}
# Fewer scenes to train with, and smaller pictures, tell as well whether the commands of a page work.
SHORTER = {
    "--scenes 20000": "--scenes 600 --data uniform --no-card",
    "render scenes.json": "render scenes.json --size 96x72",
    "-n 100000": "-n 10000",
}


def shell(text, folder, **options):
    return subprocess.run(text, shell=True, cwd=folder, env={**os.environ, **PLAIN}, text=True, timeout=240, **options)


def targets():
    return set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))


def command(line, folder, warm):
    """One line of a `sh` block."""
    if line.startswith("make "):
        assert line.split()[1] in targets()
    elif line.startswith("pip install "):
        extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
        assert set(re.findall(r"\[(\w+)\]", line)) <= set(extras)
    else:
        plain = line.startswith("scenegen ") and not set(line) & set("<>|;&$`*")
        words = ["-m", *shlex.split(line)]
        done = warm.run(words, folder, PLAIN) if plain else shell(line, folder, capture_output=True)
        assert done.returncode == 0, f"{line}\n{done.stderr}"


def work_through(page, folder, warm, shorter):
    """Runs the blocks of a page; returns the packages that some of them need and that are not installed."""
    lacking = set()
    text = page.read_text()
    for long, short in shorter.items():
        text = text.replace(long, short)
    for name in ("specs", "examples"):
        (folder / name).symlink_to(ROOT / name)
    for language, options, body in BLOCK.findall(text):
        if language == "spec":
            check_text(body, name_of(page))
            for name in re.findall(r"file=(\S+)", options):
                (folder / name).write_text(body)
        elif needs := {name for name in re.findall(r"needs=(\S+)", options) if find_spec(name) is None}:
            lacking |= needs
        elif language == "sh":
            for line in filter(None, (line.split("#")[0].strip() for line in body.splitlines())):
                command(line, folder, warm)
        elif language == "console":
            commands = [line[2:] for line in body.splitlines() if line.startswith("$ ")]
            expected = "".join(line + "\n" for line in body.splitlines() if not line.startswith("$ "))
            done = shell("\n".join(commands), folder, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
            assert done.stdout == expected
        elif "into=" in options or (language == "python" and "file=" in options):
            continue  # additions to the project: test_extending.py tries them on a copy
        elif language == "python":
            done = warm.run(["-c", body], folder, PLAIN)
            assert done.returncode == 0, done.stderr
        elif language == "toml":
            tomllib.loads(body)
        elif language not in ("golden", "text"):
            raise AssertionError(f"a block of unknown kind `{language}` in {name_of(page)}")
    return lacking


def with_blocks():
    """The pages that have any."""
    for page in PAGES:
        if BLOCK.search(page.read_text()):
            yield pytest.param(page, id=name_of(page))


@pytest.mark.long
@pytest.mark.parametrize("page", list(with_blocks()))
def test_blocks(page, tmp_path, warm):
    lacking = work_through(page, tmp_path, warm, SHORTER)
    if lacking:
        pytest.skip(f"all blocks ran but those for {', '.join(sorted(lacking))}, not installed here")


@pytest.mark.slow
def test_the_readme_word_for_word(tmp_path, warm):
    page = ROOT / "README.md"
    work_through(page, tmp_path, warm, {})


def test_what_is_shortened_is_there():
    text = "".join(page.read_text() for page in PAGES)
    assert all(long in text for long in SHORTER)


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", BLOCK.sub("", page.read_text()))
    missing = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert missing == []


@pytest.mark.parametrize("page", [page for page in PAGES if page.parent.name != "adr"], ids=name_of)
def test_every_module_that_a_page_names_exists(page):
    text = re.sub(r"^( *)```.*?^\1```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    named = set(re.findall(r"`([\w./-]+\.py)`", text))
    there = {str(path.relative_to(ROOT)) for top in FOLDERS for path in (ROOT / top).rglob("*.py")}
    whole = {name for name in named if "NAME" not in name}
    assert not [name for name in whole if not any(f"/{one}".endswith(f"/{name}") for one in there)]


def test_every_make_target_of_the_pages_exists():
    named = {name for page in PAGES for name in re.findall(r"`make ([a-z0-9-]+)`", page.read_text())}
    assert named and named <= targets()
