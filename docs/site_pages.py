"""What `make docs` adds to the folder docs/: pages made of files beside it, and links between all of them.

MkDocs calls the functions `on_...` (mkdocs.yml, `hooks`). README.md is the first page of the site; specs, examples, the
prelude, CONTRIBUTING.md, CHANGELOG.md and editors/README.md become pages, too. Links in the texts are those of the
repository; here they are rewritten to lead to the pages of the site.
"""

from __future__ import annotations

import posixpath
import re
import tempfile
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[1]
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "editors/README.md": "editors.md",
    "specs": "specs.md",
    "examples": "examples.md",
    "grammar/prelude.spec": "prelude.md",
}
"""A file or folder of the repository, and the page of the site that shows it."""

EXPORTED, EXPORTED_SCENES = "table_setting", 120  # the page without a server that docs/view.md shows

FENCE = re.compile(r"^( *)```(.*?)^\1```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The pages that are not in docs/."""
    for source, name in PAGES.items():
        files.append(File.generated(config, name, content=text_of(ROOT / source)))
    files.append(File.generated(config, f"pages/{EXPORTED}.html", content=exported(EXPORTED)))
    return files


def exported(name: str) -> str:
    """A shipped spec as a page without a server (`scenegen view --export`)."""
    from scenegen.show.view.export import export_page
    from scenegen.show.view.opened import open_

    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "page.html"
        export_page(open_(Path(name)), page, EXPORTED_SCENES, 0)
        return page.read_text(encoding="utf-8")


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """A page with its links turned, and fences as MkDocs reads them."""
    del config, files
    return turned(markdown, page.file.src_uri)


def text_of(path: Path) -> str:
    """What the page of a file or folder says."""
    if path.suffix == ".md":
        return path.read_text(encoding="utf-8")
    if path.suffix == ".spec":
        return f"# The prelude\n\nEvery spec can use these definitions.\n\n{_block(path, '')}"
    ending, title, language = {
        "specs": ("*.spec", "Specs to start from", ""),
        "examples": ("*.py", "Examples", "python"),
    }[path.name]
    parts = [f"## {one.stem}\n\n{_block(one, language)}" for one in sorted(path.glob(ending))]
    return f"# {title}\n\n" + "\n".join(parts)


def _block(path: Path, language: str) -> str:
    return f'```{language} title="{path.relative_to(ROOT)}"\n{path.read_text(encoding="utf-8")}```\n'


def turned(markdown: str, name: str) -> str:
    """The text of the page `name` of the site, for MkDocs."""
    source = {page: path for path, page in PAGES.items()}.get(name, f"docs/{name}")
    here, out, end = posixpath.dirname(source), [], 0
    for fence in FENCE.finditer(markdown):
        out += [_links(markdown[end : fence.start()], here, name), _fence(fence[0])]
        end = fence.end()
    return "".join([*out, _links(markdown[end:], here, name)])


def _links(text: str, here: str, name: str) -> str:
    """Links from a file in the folder `here`, rewritten as links between pages; the text alone where the target is not
    on the site. `\\|` in a table is replaced, too: MkDocs would show its backslash."""

    def link(match: re.Match[str]) -> str:
        words, target, anchor = match[1], match[2], match[3] or ""
        if "://" in target or target.startswith("mailto:"):
            return match[0]
        path = posixpath.normpath(posixpath.join(here, target))
        page = path.removeprefix("docs/") if path.startswith("docs/") else PAGES.get(path)
        if page is None:
            return words
        return f"[{words}]({posixpath.relpath(page, posixpath.dirname(name) or '.')}{anchor})"

    return LINK.sub(link, text).replace(r"`\|`", "<code>&#124;</code>")


def _fence(block: str) -> str:
    """`file=NAME` or `into=NAME` of the block's first line is its title; languages unknown to Pygments are left out."""
    first, _, rest = block.partition("\n")
    language, _, options = first.strip("` ").partition(" ")
    known = {"python", "sh", "console", "json", "lua", "toml", "text", "diff", "yaml"}
    title = re.search(r'(?:file|into|title)="?([^\s"]+)', options)
    head = [language if language in known else "text", *([f'title="{title[1]}"'] if title else [])]
    return f"{first[: first.index('`')]}```{' '.join(head)}\n{rest}"
