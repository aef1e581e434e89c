"""The site: every page in its navigation, every public name in the reference, and nothing loaded from elsewhere."""

import importlib.util
import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest
import yaml

import scenegen

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def pages():
    """docs/site_pages.py"""
    spec = importlib.util.spec_from_file_location("site_pages", ROOT / "docs" / "site_pages.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def leaves(tree):
    """The files that a navigation names."""
    if isinstance(tree, str):
        return [tree]
    return [name for part in (tree.values() if isinstance(tree, dict) else tree) for name in leaves(part)]


def test_the_navigation_names_every_page_once(pages):
    settings = yaml.safe_load((ROOT / "mkdocs.yml").read_text())
    docs = ROOT / "docs"
    written = [str(path.relative_to(docs)) for path in docs.rglob("*.md")]
    assert sorted(leaves(settings["nav"])) == sorted([*written, *pages.PAGES.values()])
    assert settings["theme"]["font"] is False


def test_the_reference_has_every_public_name():
    named = re.findall(r"^::: scenegen\.(\w+)$", (ROOT / "docs" / "api.md").read_text(), re.MULTILINE)
    assert sorted(named) == sorted(set(scenegen.__all__) - {"__version__"})


@pytest.mark.parametrize(
    ("name", "written", "shown"),
    [
        ("index.md", "[a](docs/language.md#tools)", "[a](language.md#tools)"),
        ("index.md", "![a](docs/images/sweep.gif)", "![a](images/sweep.gif)"),
        ("index.md", "[specs](specs), [e](editors/README.md)", "[specs](specs.md), [e](editors.md)"),
        ("experiments/exp1.md", "[a](../language.md)", "[a](../language.md)"),
        ("experiments/exp1.md", "[b](../../README.md)", "[b](../index.md)"),
        ("experiments/README.md", "[code](../../experiments) of it", "code of it"),
        (
            "relations.md",
            "[p](../grammar/prelude.spec), [w](https://example.org/)",
            "[p](prelude.md), [w](https://example.org/)",
        ),
        ("language.md", "| or | `\\|` `or` |", "| or | <code>&#124;</code> `or` |"),
        ("language.md", "```spec file=a.spec\n[x](y)\n```\n", '```text title="a.spec"\n[x](y)\n```\n'),
        ("language.md", "```python\nx\n```\n", "```python\nx\n```\n"),
    ],
)
def test_links_and_fences_of_the_site(pages, name, written, shown):
    assert pages.turned(written, name) == shown


class Loaded(HTMLParser):
    """What a page loads when it is shown; links that a reader may follow are not among it."""

    SOURCES = ("src", "srcset", "data", "poster", "action", "style")

    def __init__(self):
        super().__init__()
        self.found = []

    def handle_starttag(self, tag, attributes):
        for name, value in attributes:
            if name in self.SOURCES or (name == "href" and tag in ("link", "use", "base")):
                self.found.append(value or "")


def elsewhere(text):
    return re.findall(r"(?:https?:)?//[\w.-]+", text)


def test_what_is_loaded_from_elsewhere_is_noticed():
    parser = Loaded()
    parser.feed(
        '<a href="https://a.org"><script src="https://b.org/x.js"></script><link href="//c.org/f.css"><img src="d.png">'
    )
    assert [found for one in parser.found for found in elsewhere(one)] == ["https://b.org", "//c.org"]


@pytest.mark.slow
def test_the_site_is_built_strictly_and_loads_nothing_from_elsewhere(tmp_path):
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    environment = {**os.environ, "NO_MKDOCS_2_WARNING": "1", "SHOWN_SCENES": "1"}
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, timeout=240)
    assert done.returncode == 0, done.stderr
    made = tmp_path / "site"
    for path in made.rglob("*.html"):
        parser = Loaded()
        parser.feed(path.read_text())
        alone = path.parent.name == "pages"  # a page of `scenegen view --export` has everything in it
        assert (parser.found or alone) and not [
            one for one in parser.found if elsewhere(one) and not one.startswith("data:")
        ], path
    for path in made.rglob("*.css"):
        loaded = re.findall(r"@import[^;]+|url\((?!\W?data:)[^)]*\)", path.read_text())
        assert not [one for one in loaded if elsewhere(one)], path
    # Every relation can be found, and its picture is there; the reference says what functions take.
    found = (made / "search" / "search_index.json").read_text()
    assert "relations/#evenlyspaced" in found and "api/#scenegen.sample" in found
    assert (made / "images" / "relations" / "evenlySpaced.svg").is_file()
    assert "keep_partial" in (made / "api" / "index.html").read_text()
