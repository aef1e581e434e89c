"""Figures of the architecture: what tires its readers, how it hangs together, how far the way to 16 scenes is.

python -m tests.architecture.measure              prints them beside what is recorded
python -m tests.architecture.measure doors        the places that a figure counts, of those whose names begin so
python -m tests.architecture.measure --record     records those that got better, as `make derived` does
python -m tests.architecture.measure --accept     records those that got worse, too: say why in the commit
"""

from __future__ import annotations

import ast
import json
import re
import subprocess
import sys
import tempfile
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

from scenegen.worlds.exporting import CONTRACT

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "scenegen"
RECORDED = Path(__file__).with_name("recorded.json")

# Every figure that must not get worse, and what to do where one does; less is better.
ADVICE = {
    "banners": "delete the `# ----` line, or give the part a file of its own if others import it",
    "doors between leaves and apps": "move what both need into the core, or to the one that imports it",
    "forms of a range of phi": "take `Range` (scenegen/sampling/request.py) or one of the forms that there are",
    "texts of specs that are checked again": "hand on the spec that was checked, such as that of the set",
    "functions named by a participle or preposition": "name it by a verb phrase, or by the noun that it returns",
    "constants with one name and several meanings": "say what it limits and in which unit, or import the one there is",
    "class names defined twice or more": "find another name: one name, one meaning",
    "deepest chain of imports": "import from the module that defines a thing, or move what is shared down",
    "modules entered to draw 16 scenes": "let what only few requests need be entered by those alone",
    "functions entered to draw 16 scenes": "let what only few requests need be entered by those alone",
}

SPEC = "leftOf(mug, plate) & !closeTo(mug, plate, 0.25)\n"
# What runs in a fresh process and prints the functions that the program enters, once everything is loaded.
ENTERED = """
import sys, io, json, contextlib
functions = set()
def note(frame, event, _):
    if event == "call" and {package!r} in frame.f_code.co_filename:
        functions.add((frame.f_code.co_filename, frame.f_code.co_qualname))
from scenegen.cli import main
sys.argv[1:] = {arguments!r}
def run():
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        with contextlib.suppress(SystemExit):
            main()
run()
sys.setprofile(note)
run()
sys.setprofile(None)
print(json.dumps(sorted(functions)))
"""

Trees = dict[Path, ast.Module]


def places() -> dict[str, list[str]]:
    """The places that every figure counts, by its name."""
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in sorted(PACKAGE.rglob("*.py"))}
    entered = functions_entered()
    found = (
        banners(),
        doors(),
        forms_of_phi(trees),
        checks_again(trees),
        participles(trees),
        ambiguous_constants(trees),
        doubled_classes(trees),
        longest_chain(trees),
        sorted({file for file, _ in entered}),
        [f"{file} {name}" for file, name in entered],
    )
    return dict(zip(ADVICE, found, strict=True))


def sizes() -> dict[str, int]:
    """Figures that are printed and may grow."""
    texts = [path.read_text(encoding="utf-8") for path in PACKAGE.rglob("*.py")]
    return {"lines of Python": sum(text.count("\n") for text in texts), "files of Python": len(texts)}


def where(path: Path, node: ast.AST) -> str:
    return f"{path.relative_to(ROOT)}:{getattr(node, 'lineno', 1)}"


def banners() -> list[str]:
    """Lines of comment that part a file into rooms."""
    return [
        f"{path.relative_to(ROOT)}:{number} {line.strip()}"
        for path in sorted(PACKAGE.rglob("*.py"))
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
        if re.match(r"\s*# -{3}", line)
    ]


def doors() -> list[str]:
    """Imports that the contract of floors lets through although both ends are leaves or apps."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"][
        "contracts"
    ]
    floors = next(one for one in contracts if one["type"] == "layers" and "api" in one["layers"])
    upper = {name.strip() for layer in floors["layers"][: floors["layers"].index("api")] for name in layer.split("|")}
    ends = {door: [end.strip().split(".")[1] for end in door.split("->")] for door in floors.get("ignore_imports", ())}
    return [door for door, names in ends.items() if upper.issuperset(names)]


FORM = re.compile(r"_?(Ends|Phi|Ranges?|RangeData|StratumData|Phi\w*(Box|Ranges?|Of|Stratum|Bounds|Interval|Cells?))")


def forms_of_phi(trees: Trees) -> list[str]:
    """Classes and names of types that say a range of phi; the language's own Range is one of whole numbers."""
    found = []
    for path, tree in trees.items():
        for node in tree.body if "lang" not in path.relative_to(PACKAGE).parts else ():
            names = [node.name] if isinstance(node, ast.ClassDef) else targets(node)
            found += [f"{where(path, node)} {name}" for name in names if FORM.fullmatch(name)]
    return found


def checks_again(trees: Trees) -> list[str]:
    """Calls that check the text of a spec that was checked before: one that a header, a set or a spec carries."""
    found = []
    for path, tree in trees.items():
        if path.is_relative_to(PACKAGE / "lang") or path == PACKAGE / "api" / "spec.py":
            continue
        for node in ast.walk(tree):
            if not isinstance(node, ast.Call) or not node.args:
                continue
            function, text = ast.unparse(node.func).rpartition(".")[2], ast.unparse(node.args[0])
            if function in ("check_text", "parse") and re.search(r"\bspec\.source$", text):
                found.append(f"{where(path, node)} {ast.unparse(node)}")
    return found


PARTICIPLES = set(
    "told seen held said drawn met begun found made given taken kept left shown written known gone done built sent "
    "lost spent bound bought brought caught chosen driven fallen felt grown heard led meant moved paid sought sold "
    "slept stood stuck struck taught thought thrown torn understood won worn laid lain hidden broken spoken "
    "frozen".split()
)
PREPOSITIONS = set(
    "of at own each here apart aside one by to in on for with from about after before beside between beyond under over "
    "off out up down near along among within without across around as than other others both all some none".split()
)
NOUNS_AND_VERBS = {"seed", "need", "feed", "speed", "embed", "exceed", "proceed"}


def participles(trees: Trees) -> list[str]:
    """Functions, methods and properties whose whole name is a participle or a preposition: what do they give?"""

    def names_nothing(name: str) -> bool:
        regular = name.endswith("ed") and "_" not in name and len(name) > 4 and name not in NOUNS_AND_VERBS
        return regular or name in PARTICIPLES | PREPOSITIONS

    return [
        f"{where(path, node)} {node.name}"
        for path, tree in trees.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and names_nothing(node.name.strip("_"))
    ]


def targets(node: ast.stmt) -> list[str]:
    """The names that a statement of a module assigns to."""
    ends = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [end.id for end in ends if isinstance(end, ast.Name)]


def ambiguous_constants(trees: Trees) -> list[str]:
    """Names in capitals that modules give different values; not those that a contract asks of each of them."""
    values: dict[str, dict[str, str]] = defaultdict(dict)
    for path, tree in trees.items():
        for node in tree.body:
            for name in set(targets(node)).difference(CONTRACT):
                if re.fullmatch(r"_?[A-Z][A-Z0-9_]*", name) and (value := getattr(node, "value", None)):
                    values[name][where(path, node)] = ast.unparse(value)
    return [f"{name} {' '.join(sorted(given))}" for name, given in sorted(values.items()) if len({*given.values()}) > 1]


def doubled_classes(trees: Trees) -> list[str]:
    found: dict[str, list[str]] = defaultdict(list)
    for path, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                found[node.name].append(where(path, node))
    return [f"{name} {' '.join(given)}" for name, given in sorted(found.items()) if len(given) > 1]


def longest_chain(trees: Trees) -> list[str]:
    """The modules of the longest chain of imports that are followed when a module is loaded."""
    names = {".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path for path in trees}
    imports = {name: sorted(imported(name, trees[path], set(names))) for name, path in names.items()}
    chains: dict[str, list[str]] = {}

    def chain(name: str, above: frozenset[str]) -> list[str]:
        if name in above:
            return []
        if name not in chains:
            chains[name] = [name, *max((chain(one, above | {name}) for one in imports[name]), key=len, default=[])]
        return chains[name]

    return max((chain(name, frozenset()) for name in imports), key=len)


def imported(name: str, tree: ast.Module, known: set[str]) -> set[str]:
    """The modules of the package that a module loads when it is loaded itself."""

    def visit(node: ast.AST) -> Iterator[str]:
        if isinstance(node, ast.Import):
            yield from (one.name for one in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for one in node.names:  # a package that a module of its own is taken from is not imported itself
                whole = f"{node.module}.{one.name}"
                yield whole if whole in known else node.module
        elif isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or (
            isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING"
        ):
            return
        for child in ast.iter_child_nodes(node):
            yield from visit(child)

    return {one for one in visit(tree) if one in known and one != name}


def functions_entered() -> list[tuple[str, str]]:
    """File and name of each function that is entered to draw 16 scenes of one line."""
    with tempfile.TemporaryDirectory() as folder:
        spec = Path(folder, "one.spec")
        spec.write_text(SPEC)
        words = ["sample", str(spec), "--phi", "0:0.2", "-n", "16", "--out", str(Path(folder, "s.json")), "-q"]
        program = ENTERED.format(package=str(PACKAGE), arguments=words)
        done = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return [(str(Path(file).relative_to(ROOT)), name) for file, name in json.loads(done.stdout.splitlines()[-1])]


def recorded() -> dict[str, int]:
    """The figures that must not get worse."""
    found: dict[str, int] = json.loads(RECORDED.read_text())
    return found


def main(words: list[str]) -> None:
    found = places()
    counts = {name: len(each) for name, each in found.items()}
    before = recorded()
    if "--accept" in words or "--record" in words:
        best = {
            name: count if "--accept" in words else min(count, before.get(name, count))
            for name, count in counts.items()
        }
        RECORDED.write_text(json.dumps(best, indent=1) + "\n")
        before = recorded()
    elif words:
        print(*(line for name, each in found.items() if name.startswith(words[0]) for line in each), sep="\n")
        return
    for name, count in counts.items():
        print(f"{name:48} {count:>7,} {before.get(name, count):>7,} recorded")
    for name, size in sizes().items():
        print(f"{name:48} {size:>7,}         may grow")


if __name__ == "__main__":
    main(sys.argv[1:])
