"""The scripts that make pages and pictures, and `make derived`: what they name is there. None is run in whole."""

import ast
import importlib
import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from scenegen.resources import shipped_specs

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = sorted((ROOT / "docs").glob("make_*.py"))


@pytest.fixture
def page_pictures(monkeypatch):
    """docs/make_page_pictures.py, loaded without a browser."""
    browser = ModuleType("playwright.sync_api")
    browser.sync_playwright = None
    monkeypatch.setitem(sys.modules, "playwright", ModuleType("playwright"))
    monkeypatch.setitem(sys.modules, "playwright.sync_api", browser)
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    spec = importlib.util.spec_from_file_location("make_page_pictures", ROOT / "docs" / "make_page_pictures.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_page_pictures_go_where_the_page_has_them(page_pictures):
    assert sorted(path.stem for path in page_pictures.EXAMPLES.glob("*.jpg")) == sorted(shipped_specs())
    for name, (what, _) in page_pictures.SHOWN.items():
        assert (page_pictures.IMAGES / name).is_file()
        assert what in shipped_specs() or "\n" in what or Path(what).is_file()  # a name, a text, or a file


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_what_a_script_imports_of_ours_is_there(script):
    for node in ast.walk(ast.parse(script.read_text(encoding="utf-8"))):
        if (
            isinstance(node, ast.ImportFrom)
            and node.module
            and node.module.split(".")[0] in ("scenegen", "experiments")
        ):
            module = importlib.import_module(node.module)
            for one in node.names:
                assert hasattr(module, one.name) or importlib.util.find_spec(f"{node.module}.{one.name}"), one.name


def test_make_runs_scripts_that_are_there():
    named = re.findall(r"^\t.*\$\(BIN\)/python ([\w/]+\.py)", (ROOT / "Makefile").read_text(), re.MULTILINE)
    assert {"docs/make_relations.py", "docs/make_llms.py", "docs/make_page_pictures.py"} <= set(named)
    assert [name for name in named if not (ROOT / name).is_file()] == []


def test_ci_compares_derived_files():
    words = (ROOT / ".ci" / "run").read_text()
    assert words.index("make derived") < words.index("git diff --exit-code")
