"""No circles of imports: neither between modules nor between the parts of a package, imports for types included."""

import copy
import tomllib
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).resolve().parents[2]

PACKAGES = ("scenegen", "experiments")


@pytest.fixture(scope="module")
def graph():
    return grimp.build_graph(*PACKAGES, cache_dir=None)


def circle(imports):
    """A circle of modules, each importing the next; empty where there is none."""
    try:
        TopologicalSorter(imports).prepare()
    except CycleError as error:
        return error.args[1][::-1]
    return []


def between_parts(graph, package):
    """Which parts of a package import which others, by any of their modules."""
    of = {module: part for part in graph.find_children(package) for module in {part, *graph.find_descendants(part)}}
    imports = {part: set() for part in of.values()}
    for module, part in of.items():
        imports[part] |= {of[other] for other in graph.find_modules_directly_imported_by(module) if other in of} - {
            part
        }
    return imports


def doors():
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    return [line.split(" -> ") for line in contracts[0]["ignore_imports"]]


def test_circles_are_found():
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) in (["a", "b", "c", "a"], ["b", "c", "a", "b"],
                                                                      ["c", "a", "b", "c"])  # fmt: skip
    assert circle({"a": {"b", "c"}, "b": {"c"}, "c": set()}) == []
    graph = grimp.ImportGraph()
    for name in ("x", "x.a", "x.a.one", "x.a.two", "x.b"):
        graph.add_module(name)
    graph.add_import(importer="x.a.one", imported="x.b")
    graph.add_import(importer="x.b", imported="x.a.two")
    assert not circle({name: graph.find_modules_directly_imported_by(name) for name in graph.modules})
    assert circle(between_parts(graph, "x"))


def test_no_circles_between_modules(graph):
    imports = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    assert len(imports) > 400 and circle(imports) == []


def test_no_circles_within_packages(graph):
    graph = copy.deepcopy(graph)
    for door in doors():  # pyproject.toml lists the ways from the core to its leaves one by one
        graph.remove_import(importer=door[0], imported=door[1])
    packages = [module for module in graph.modules if graph.find_children(module)]
    assert set(PACKAGES) < set(packages)
    found = {package: circle(between_parts(graph, package)) for package in packages}
    assert {package: modules for package, modules in found.items() if modules} == {}
