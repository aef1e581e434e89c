"""What docs/extending.md adds, section by section, made in a copy of the project."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "extending.md"
FOLDERS = ("scenegen", "experiments", "grammar", "specs", "tests")
FILES = ("pyproject.toml", "docs/curriculum.md", "docs/api.md", "docs/sampling.md")
BLOCK = re.compile(r"^```\w+ (file|into)=(\S+)(?: (table|after)=(\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Addition:
    """A new file; or lines at the end of a table of a file, or `after` its first line that begins with a word; or else
    a change of a file, as in a diff."""

    path: str
    new: bool
    where: str
    name: str
    text: str

    def make(self, project):
        path = project / self.path
        if self.new:
            assert not path.exists(), f"{self.path} is there already"
            path.write_text(self.text)
            return
        old = path.read_text()
        if not self.where:
            lines = self.text.splitlines(keepends=True)
            before, now = ("".join(line[1:] for line in lines if line[0] in f" {sign}").rstrip() for sign in "-+")
            assert old.count(before) == 1, f"{self.path} has no or several\n{before}"
            path.write_text(old.replace(before, now))
            return
        end = end_of_table(old, self.name) if self.where == "table" else after(old, self.name)
        path.write_text(old[:end] + self.text + old[end:])


def end_of_table(text, name):
    """Where a literal that is assigned to `name` ends: before its closing bracket, which opens a line; inside of a
    generator's parentheses if it has them."""
    start = re.search(rf"^{re.escape(name)}\b[^\n]*= ?[^\n]*[\[({{]$", text, re.MULTILINE)
    assert start, f"no table {name}"
    close = re.compile(r"^(    \)\n)?[\])}]", re.MULTILINE).search(text, start.end())
    return close.start()


def after(text, name):
    line = re.search(rf"^[ |`:]*{re.escape(name)}\b.*\n", text, re.MULTILINE)
    assert line, f"no line begins with {name}"
    return line.end()


def sections(page):
    """Title -> additions."""
    found = {}
    for part in re.split(r"^## ", page, flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("\n")
        found[title] = [
            Addition(path, kind == "file", where, name, text)
            for kind, path, where, name, text in BLOCK.findall(body)
            if "/" in path  # others are files of the reader's own
        ]
    return {title: additions for title, additions in found.items() if additions}


def copied(folder):
    """A copy of the project, with its compiled modules: nothing has to be compiled again."""
    for name in FOLDERS:
        shutil.copytree(ROOT / name, folder / name)
    for name in FILES:
        (folder / name).parent.mkdir(exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    return folder


def python(project, *words):
    """Run Python in the copy; what it writes on standard output. Fails where it fails."""
    environment = {**os.environ, "PYTHONPATH": str(project), "OMP_NUM_THREADS": "1", "NO_COLOR": "1", "COLUMNS": "120"}
    command = [sys.executable, *words]
    done = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout
