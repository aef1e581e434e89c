"""What serves until it is ended: `scenegen view`, a page for people, and `scenegen lsp`, for editors."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from scenegen.cli.options import argument, option
from scenegen.cli.output import complain, print_error
from scenegen.errors import RequestError
from scenegen.errors.files import CANNOT_READ
from scenegen.errors.program import SERVED_IN_PUBLIC
from scenegen.errors.requests import NOT_INSTALLED, OUT_OF_PLACE

LOOPBACK = ("127.0.0.1", "localhost", "::1")


def view(
    what: Path | None = argument(
        "A spec, a file of scenes or motions, a model or a folder.", "[SPEC|SCENES|MODEL]", default=None
    ),
    port: int | None = option("The port; any free one if left out.", min=0, max=65535),
    host: str = option("The address to listen on.", default="127.0.0.1"),
    public: bool = option("Let other machines in: needed for a --host beyond this one."),
    browser: bool = option("Open the link in a browser.", flags="--open"),
    export: Path | None = option("Write a page that needs no server instead.", "FILE"),
    n: int = option("With --export: how many scenes or motions.", default=200, min=1, max=400),
    seed: int = option("With --export: the seed.", default=0, min=0),
) -> int:
    """Open a page where you write a spec and see its scenes while you type.

    \b
      scenegen view my.spec
      scenegen view scenes.json
      # motions, or a spec with `time`, are played
      scenegen view motions.jsonl
      scenegen view my.safetensors
      # one file with the spec, its scenes and their phi, to send or to publish
      scenegen view my.spec --export page.html

    The page is served from this machine to this machine alone, under a link with a secret token. It reads and saves
    specs in the folder of what was opened. End it with Ctrl-C. Needs the extra `view`: pip install
    "scenegen\\[view]"; --export needs nothing more.
    """
    from scenegen.page.project import open_

    if host not in LOOPBACK and not public:
        raise RequestError(
            OUT_OF_PLACE(
                option=f"--host {host}",
                rule="is an address that other machines can reach",
                remedy="everyone with the link can then read and write specs in the opened folder; add --public if you "
                "mean it",
            )
        )
    opened = open_(what)
    if export is not None:
        import shlex

        from scenegen.page.export import export_page

        name = shlex.quote(str(what) if what is not None else opened.name)
        command = f"scenegen view {name} --export {shlex.quote(export.name)} -n {n} --seed {seed}"
        size = export_page(opened, export, n, seed, command)
        print_error(f"wrote {export}, {size / 1e6:.1f} MB: open it in any browser")
        return 0
    with _needs(("starlette", "uvicorn", "websockets", "h11"), "for the page", "view", "; --export works without"):
        from scenegen.page.serve import serve
    if host not in LOOPBACK:
        complain(SERVED_IN_PUBLIC(host=host))

    def announce(link: str) -> None:
        print_error(f"{opened.name}: {link}")
        print_error("Ctrl-C ends it")
        if browser:
            import webbrowser

            webbrowser.open(link)

    return serve(opened, host, port, announce)


def lsp(
    stdio: bool = option("Talk over standard input and output; there is no other way.", default=True),
    root: Path | None = option("Specs may import what lies below this folder, not below their own alone."),
) -> int:
    """Serve editors: mistakes as you type, hover, completion, definitions, formatting and renaming.

    \b
      # what an editor starts
      scenegen lsp --stdio
      # specs that import from a folder above their own
      scenegen lsp --root specs

    It speaks the Language Server Protocol over standard input and output, and ends when the editor says so. How to set
    up an editor is in editors/README.md. Needs the extra `lsp`: pip install "scenegen\\[lsp]".
    """
    del stdio  # editors that know several ways say which one they use
    with _needs(("pygls", "lsprotocol"), "for the language server", "lsp"):
        from scenegen.editors.lsp.server import serve
    if root is not None and not root.is_dir():
        remedy = "name the folder that specs may read"
        raise RequestError(CANNOT_READ(path=root, reason="it is not a folder", remedy=remedy))
    return serve(root)


@contextlib.contextmanager
def _needs(packages: tuple[str, ...], purpose: str, extra: str, otherwise: str = "") -> Iterator[None]:
    """Around an import: raises RequestError where one of these packages of an extra is not installed."""
    try:
        yield
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] not in packages:
            raise
        command = f'pip install "scenegen-dsl[{extra}]"{otherwise}'
        raise RequestError(NOT_INSTALLED(package=packages[0], purpose=purpose, command=command)) from None
