"""What `make docs` adds to the folder docs/: pages made of files beside it, and links between all of them.

MkDocs calls the functions `on_...` (mkdocs.yml, `hooks`). README.md is the first page of the site; specs, examples, the
prelude, CONTRIBUTING.md, CHANGELOG.md and editors/README.md become pages, too. Links in the texts are those of the
repository; here they are rewritten to lead to the pages of the site.
"""

from __future__ import annotations

import math
import os
import posixpath
import re
import tempfile
import time
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import scenegen
from scenegen.errors.catalog import GROUPS, CatalogEntry, catalog
from scenegen.resources import shipped_specs

ROOT = Path(__file__).resolve().parents[1]
PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "editors/README.md": "editors.md",
    "specs": "specs.md",
    "examples": "examples.md",
    "grammar/prelude.spec": "prelude.md",
    "scenegen/errors/explanations": "errors.md",
}
"""A file or folder of the repository, and the page of the site that shows it."""

EXPORTED, EXPORTED_SCENES = "table_setting", 120  # the page without a server that docs/view.md shows

SHOWN_SCENES = int(os.environ.get("SHOWN_SCENES", "16"))  # of each shipped spec; their pictures take two CPU minutes
SPECS = """# Gallery of specs to start from

All commands take them by name: `scenegen sample table_setting --phi 0: -n 16`. `scenegen specs` lists them, and
`scenegen specs NAME` prints one to start from. Pictures and times are those of the machine that made this site.

"""

ERRORS = """# Errors and warnings

Every error, warning and note has a code, as in `error[unknown-relation]`. Codes are stable: scripts may rely on them,
not on the texts. `scenegen explain CODE` prints what this page says.

The texts are made from facts, such as the unknown name and the nearest known one. `scenegen check --json` writes the
code and the `facts` of each diagnostic ([formats.md](formats.md#diagnostics-as-data)). The language server sends the
facts in `data`. Exceptions in Python have both: `error.diagnostics[0].code` and `.facts`. Below, the facts of each kind
are listed; not every diagnostic has all of them. Diagnostics of specs can also have `expansion`, `where` and `called`:
the definition or quantifier that the problem is in, the values of its variables, and the place that uses it.

Examples are specs, commands (`$`) or Python (`>>>`). Commands use `table.spec` and `two.spec`, specs of a mug and a
plate with the label `task` and, in the second, `safe`; and `scenes.json`, scenes of the first. In Python, `spec` and
`two` are these specs; `np` is numpy, `curriculum` is `scenegen.curriculum`, and `strategy` is from its `strategies`.
"""

FENCE = re.compile(r"^( *)```(.*?)^\1```$", re.MULTILINE | re.DOTALL)
LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s]+)(#[^)\s]*)?\)")


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """The pages that are not in docs/."""
    for source, name in PAGES.items():
        files.append(File.generated(config, name, content=text_of(ROOT / source)))
    for name in shipped_specs():
        shown, sheet = shipped(name)
        page = files.get_file_from_path(PAGES["specs"])
        page.content_string += shown
        files.append(File.generated(config, f"images/specs/{name}.png", content=sheet))
    files.append(File.generated(config, f"pages/{EXPORTED}.html", content=exported(EXPORTED)))
    return files


def shipped(name: str) -> tuple[str, bytes]:
    """The section of a shipped spec on the page of specs: 16 scenes in which all labels hold, how long they took, the
    text; and the picture of the scenes, a PNG."""
    path = shipped_specs()[name]
    spec = scenegen.load(path)
    began = time.process_time()
    scenes = scenegen.sample(spec, phi=dict.fromkeys(spec.labels, (0.0, None)), n=SHOWN_SCENES, seed=0)
    seconds = time.process_time() - began
    rare = 10.0 ** -scenes.header.sampler["log10_probability"]
    words = f"1 in {rare:,.0f}" if rare < 1e6 else f"1 in 10^{math.log10(rare):.0f}"
    with tempfile.TemporaryDirectory() as folder:
        (sheet,) = scenes.figures(folder, "sheet", size=(160, 120))
        picture = sheet.read_bytes()
    caption = (
        f"{SHOWN_SCENES} scenes in which {' and '.join(spec.labels)} hold, unselected: {seconds:.2f} s of CPU time. "
        f"{words} of random scenes would do."
    )
    shown = f"![{SHOWN_SCENES} scenes of {name}](images/specs/{name}.png)\n\n{caption}"
    return f"## {name}\n\n{shown}\n\n{_block(path, '')}\n", picture


def exported(name: str) -> str:
    """A shipped spec as a page without a server (`scenegen view --export`)."""
    from scenegen.page.export import export_page
    from scenegen.page.project import open_

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
    if path.name == "explanations":
        return errors()
    if path.name == "specs":
        return SPECS
    return "# Examples\n\n" + "\n".join(
        f"## {one.stem}\n\n{_block(one, 'python')}" for one in sorted(path.glob("*.py"))
    )


def errors() -> str:
    """Every kind of problem, as `scenegen explain` shows it."""
    entries = catalog().values()
    out = [ERRORS]
    for group, title in GROUPS.items():
        out.append(f"## {title}\n")
        out += [_section(one) for one in entries if one.group == group]
    return "\n".join(out)


def _section(entry: CatalogEntry) -> str:
    severity = "" if entry.kind.severity == "error" else f" ({entry.kind.severity})"
    out = [f"### {entry.kind.code}\n", f"{entry.means}{severity}\n"]
    if entry.facts:
        out.append(f"Facts: {', '.join(f'`{name}`' for name in entry.facts)}\n")
    for name, text in (("example", entry.example), ("mended", entry.mended)):
        if text:
            shown = "".join(char if char == "\n" or char.isprintable() else f"\\u{ord(char):04x}" for char in text)
            out.append(f"{name.capitalize()}:\n\n```text\n{shown}\n```\n")
    return "\n".join(out)


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
