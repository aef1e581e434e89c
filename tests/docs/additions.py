"""What docs/extending.md adds, section by section, made in a copy of the project."""

import ast
import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "extending.md"
FOLDERS = ("scenegen", "experiments", "grammar", "specs", "tests", "page/src/panels")
FILES = ("pyproject.toml", *(f"docs/{name}" for name in ("curriculum.md", "api.md", "sampling.md", "language.md")))
FILES += ("docs/time.md", "docs/llms.txt", "docs/make_llms.py")
BLOCK = re.compile(r"^```\w+ (file|into)=(\S+)(?: (\w+)=(\S+))?\n(.*?)^```$", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Addition:
    """A new file, or a change of one at the place that its anchor, `where` and `name`, says."""

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
        assert self.where in ANCHORS, f"no anchor is called {self.where}"
        try:
            path.write_text(ANCHORS[self.where](path.read_text(), self.name, self.text))
        except AssertionError as error:
            raise AssertionError(f"{self.path}: {error}; mend the block of {self.path} in docs/extending.md") from error


def add_to_table(text, name, lines):
    """At the end of a literal that is assigned to `name`: before its closing bracket, which opens a line; inside of a
    generator's parentheses if it has them."""
    start = re.search(rf"^(?:const )?{re.escape(name)}\b[^\n]*= ?[^\n]*[\[({{]$", text, re.MULTILINE)
    assert start, f"no table {name}"
    close = re.compile(r"^(    \)\n)?[\])}]", re.MULTILINE).search(text, start.end()).start()
    return text[:close] + lines + text[close:]


def add_after(text, name, lines):
    """After the first line that begins with a word."""
    line = re.search(rf"^[ |`:]*{re.escape(name)}\b.*\n", text, re.MULTILINE)
    assert line, f"no line begins with {name}"
    return text[: line.end()] + lines + text[line.end() :]


def add_before(text, name, lines):
    """Before a function, class or table, and its comments."""
    start, _ = extent(text, name)
    before = text[:start].splitlines(keepends=True)
    while before and before[-1].startswith(("#", "@")):
        start -= len(before.pop())
    return f"{text[:start]}{lines}\n\n{text[start:]}"


def change_in(text, name, lines):
    """In a function, class or table: what `-` says, which is there once, becomes what `+` says."""
    start, end = extent(text, name)
    part = text[start:end]
    rows = lines.splitlines(keepends=True)
    before, now = ("".join(row[1:] for row in rows if row[0] in f" {sign}").rstrip() for sign in "-+")
    assert part.count(before) == 1, f"{name} has no or several\n{before}"
    return text[:start] + part.replace(before, now) + text[end:]


def add_argument(text, name, lines):
    """To the first call of a function in another: `call=sample:SampleRequest`."""
    function, _, called = name.partition(":")
    calls = [one for one in ast.walk(node_of(text, function)) if isinstance(one, ast.Call)]
    calls = [one for one in calls if ast.unparse(one.func).rpartition(".")[2] == called]
    assert calls, f"{function} does not call {called}"
    last = max((*calls[0].args, *calls[0].keywords), key=lambda one: (one.end_lineno, one.end_col_offset))
    end = offset(text, last.end_lineno, last.end_col_offset)
    return f"{text[:end]}, {lines.strip().removesuffix(',')}{text[end:]}"


def add_parameter(text, name, lines):
    """At the end of a function's parameters."""
    arguments = node_of(text, name).args
    assert not arguments.kwarg, f"{name} has **"
    parts = [*arguments.args, *arguments.kwonlyargs, *arguments.defaults, *filter(None, arguments.kw_defaults)]
    last = max((one for part in parts for one in ast.walk(part) if hasattr(one, "end_lineno")), key=place)
    end = offset(text, *place(last))
    return f"{text[:end]},\n{lines.rstrip().removesuffix(',')}{text[end:]}"


def add_import(text, name, lines):
    """Where isort wants it: before the first `from` of a module that follows."""
    module = lines.split()[1]
    top = [node for node in ast.parse(text).body if isinstance(node, ast.ImportFrom) and node.module != "__future__"]
    after = [node for node in top if node.module > module and node.module.split(".")[0] == module.split(".")[0]]
    assert name in lines and after, f"no import of a module after {module}"
    start = offset(text, after[0].lineno, 0)
    return text[:start] + lines + text[start:]


ANCHORS = {
    "import": add_import,
    "table": add_to_table,
    "after": add_after,
    "before": add_before,
    "in": change_in,
    "call": add_argument,
    "parameters": add_parameter,
}


def place(node):
    return node.end_lineno, node.end_col_offset


def offset(text, line, column):
    """Where a place of a syntax tree is in the text."""
    lines = text.splitlines(keepends=True)
    return sum(map(len, lines[: line - 1])) + len(lines[line - 1].encode()[:column].decode())


def node_of(text, name):
    """The function, class or assignment of a module that has a name."""
    for node in ast.parse(text).body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        if getattr(node, "name", None) == name or name in [getattr(one, "id", None) for one in targets]:
            return node
    raise AssertionError(f"there is no {name}")


def extent(text, name):
    node = node_of(text, name)
    return offset(text, node.lineno, 0), offset(text, *place(node))


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
        shutil.copytree(ROOT / name, folder / name, dirs_exist_ok=True)
    for name in FILES:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(ROOT / name, folder / name)
    return folder


def python(project, *words):
    """Run Python in the copy; what it writes on standard output. Fails where it fails."""
    environment = {**os.environ, "PYTHONPATH": str(project), "OMP_NUM_THREADS": "1", "NO_COLOR": "1", "COLUMNS": "120"}
    command = [sys.executable, *words]
    done = subprocess.run(command, cwd=project, env=environment, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, f"{done.stdout}\n{done.stderr}"
    return done.stdout
