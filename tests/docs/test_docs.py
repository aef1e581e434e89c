"""Every code block of the README and the docs is run: commands, programs and specs alike.

`spec` blocks must pass the checker (`spec file=NAME` also writes them for later blocks of the page); `sh` blocks run
line by line; `console` blocks are run and their output compared; `python` blocks are executed. A page's blocks share a
folder that holds `specs`. `golden` blocks are put to work by test_relations_page.py. Links between pages must lead
somewhere.
"""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from scenegen.lang.check import check_text

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(r"^```(\w*)[ ]*([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def name_of(page):
    return str(page.relative_to(ROOT))


def run(command, folder, **options):
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "NO_COLOR": "1", "TERM": "dumb", "COLUMNS": "100"}
    return subprocess.run(command, cwd=folder, env=environment, text=True, timeout=240, **options)


def targets():
    return set(re.findall(r"^([a-z0-9-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))


@pytest.mark.parametrize("page", [page for page in PAGES if BLOCK.search(page.read_text())], ids=name_of)
def test_blocks(page, tmp_path):
    (tmp_path / "specs").symlink_to(ROOT / "specs")
    for language, options, body in BLOCK.findall(page.read_text()):
        if language == "spec":
            check_text(body, name_of(page))
            for name in re.findall(r"file=(\S+)", options):
                (tmp_path / name).write_text(body)
        elif language == "sh":
            for line in filter(None, (line.split("#")[0].strip() for line in body.splitlines())):
                if line.startswith("make "):
                    assert line.split()[1] in targets()
                    continue
                done = run(line, tmp_path, shell=True, capture_output=True)
                assert done.returncode == 0, f"{line}\n{done.stderr}"
        elif language == "console":
            commands = [line[2:] for line in body.splitlines() if line.startswith("$ ")]
            expected = "".join(line + "\n" for line in body.splitlines() if not line.startswith("$ "))
            done = run("\n".join(commands), tmp_path, shell=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
            assert done.stdout == expected
        elif "into=" in options or (language == "python" and "file=" in options):
            continue  # additions to the project: test_extending.py tries them on a copy
        elif language == "python":
            done = run([sys.executable, "-c", body], tmp_path, capture_output=True)
            assert done.returncode == 0, done.stderr
        elif language != "golden":
            raise AssertionError(f"a block of unknown kind `{language}` in {name_of(page)}")


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_links_lead_somewhere(page):
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", BLOCK.sub("", page.read_text()))
    missing = [link for link in links if "://" not in link and not (page.parent / link).exists()]
    assert missing == []


def test_every_make_target_of_the_pages_exists():
    named = {name for page in PAGES for name in re.findall(r"`make ([a-z0-9-]+)`", page.read_text())}
    assert named and named <= targets()
