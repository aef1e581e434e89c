"""Figures of the architecture: how large it is, how it hangs together, and how far the way to 16 scenes is.

python -m tests.architecture.measure            prints them beside what is recorded
python -m tests.architecture.measure --record   records them
"""

from __future__ import annotations

import ast
import json
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "scenegen"
RECORDED = Path(__file__).with_name("recorded.json")

SPEC = "leftOf(mug, plate) & !closeTo(mug, plate, 0.25)\n"
# What runs in a fresh process; the last line it prints is its figures.
LOADED = """
import sys, io, contextlib
from scenegen.cli import main
sys.argv[1:] = {arguments!r}
with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
    with contextlib.suppress(SystemExit):
        main()
print(sum(name.split(".")[0] == "scenegen" for name in sys.modules))
"""
ENTERED = """
import sys, io, contextlib
functions = set()
def seen(frame, event, _):
    if event == "call" and {package!r} in frame.f_code.co_filename:
        functions.add((frame.f_code.co_filename, frame.f_code.co_qualname))
from scenegen.cli import main
sys.argv[1:] = {arguments!r}
def run():
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        with contextlib.suppress(SystemExit):
            main()
run()  # loads what is loaded when it is needed
sys.setprofile(seen)
run()
sys.setprofile(None)
print(len({{file for file, _ in functions}}), len(functions))
"""


def figures() -> dict[str, int]:
    """Every figure by name; less is better."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}
    names = {path: _module(path) for path in trees}
    imports = {name: _imports(name, trees[path], set(names.values())) for path, name in names.items()}
    at_load = {name: _imports(name, trees[path], set(names.values()), inside=False) for path, name in names.items()}
    importers: dict[str, set[str]] = defaultdict(set)
    for name, found in imports.items():
        for one in found:
            importers[one].add(name)
    classes = Counter(node.name for tree in trees.values() for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    alone = [
        path
        for path, name in names.items()
        if path.name != "__init__.py"
        and len(importers[name]) == 1
        and next(iter(importers[name])).rpartition(".")[0] == name.rpartition(".")[0]
    ]
    with tempfile.TemporaryDirectory() as folder:
        spec = Path(folder, "one.spec")
        spec.write_text(SPEC)
        sample = ["sample", str(spec), "--phi", "0:0.2", "-n", "16", "--out", str(Path(folder, "s.json")), "-q"]
        check = ["check", str(spec)]
        (checks,), (samples,) = (_run(LOADED.format(arguments=arguments)) for arguments in (check, sample))
        modules, functions = _run(ENTERED.format(package=str(PACKAGE), arguments=sample))
    return {
        "lines of Python": sum(len(path.read_text(encoding="utf-8").splitlines()) for path in trees),
        "files of Python": len(trees),
        "folders directly under scenegen/": sum(any(one.rglob("*.py")) for one in PACKAGE.iterdir() if one.is_dir()),
        "files with one importer, in the same folder": len(alone),
        "class names defined twice or more": sum(count > 1 for count in classes.values()),
        "own modules loaded by `check`": checks,
        "own modules loaded by `sample`": samples,
        "modules entered to draw 16 scenes": modules,
        "functions entered to draw 16 scenes": functions,
        "deepest chain of imports": _deepest(at_load),
    }


def _module(path: Path) -> str:
    return ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")


def _imports(name: str, tree: ast.Module, known: set[str], inside: bool = True) -> set[str]:
    """The modules of the package that a module imports; without `inside`, those that it loads when it is loaded."""
    found: set[str] = set()

    def visit(node: ast.AST) -> None:
        if isinstance(node, ast.Import):
            found.update(one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for one in node.names:  # a package that a module of its own is taken from is not imported itself
                whole = f"{node.module}.{one.name}"
                found.add(whole if whole in known else node.module)
        elif not inside and (
            isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
            or (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
        ):
            return
        for child in ast.iter_child_nodes(node):
            visit(child)

    visit(tree)
    return {one for one in found if one in known and one != name}


def _deepest(imports: dict[str, set[str]]) -> int:
    """The number of modules in the longest chain of imports."""
    lengths: dict[str, int] = {}

    def length(name: str, above: tuple[str, ...]) -> int:
        if name in above:
            return 0
        if name not in lengths:
            lengths[name] = 1 + max((length(one, (*above, name)) for one in imports[name]), default=0)
        return lengths[name]

    return max(length(name, ()) for name in imports)


def _run(program: str) -> list[int]:
    done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [int(word) for word in done.stdout.splitlines()[-1].split()]


def recorded() -> dict[str, int]:
    """The figures that must not get worse."""
    found: dict[str, int] = json.loads(RECORDED.read_text())
    return found


def main() -> None:
    found = figures()
    if "--record" in sys.argv[1:]:
        RECORDED.write_text(json.dumps(found, indent=1) + "\n")
    before = recorded()
    for name, value in found.items():
        print(f"{name:45} {value:>7,} {before[name]:>7,} recorded")


if __name__ == "__main__":
    main()
