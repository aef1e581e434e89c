"""`scenegen view`: write a spec and see its scenes while typing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

LOOPBACK = ("127.0.0.1", "localhost", "::1")


def view(
    what: Annotated[
        Path | None,
        typer.Argument(
            help="A spec, a file of scenes or motions, a model or a folder.",
            metavar="[SPEC|SCENES|MODEL]",
            show_default=False,
        ),
    ] = None,
    port: Annotated[int | None, typer.Option(help="The port; any free one if left out.", min=0, max=65535)] = None,
    host: Annotated[str, typer.Option(help="The address to listen on.")] = "127.0.0.1",
    public: Annotated[
        bool, typer.Option("--public", help="Let other machines in: needed for a --host beyond this one.")
    ] = False,
    browser: Annotated[bool, typer.Option("--open", help="Open the link in a browser.")] = False,
    export: Annotated[
        Path | None,
        typer.Option("--export", help="Write a page that needs no server instead.", metavar="FILE", show_default=False),
    ] = None,
    n: Annotated[int, typer.Option("-n", help="With --export: how many scenes or motions.", min=1, max=400)] = 200,
    seed: Annotated[int, typer.Option("--seed", help="With --export: the seed.", min=0)] = 0,
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
    from scenegen.cli.output import complain, print_error
    from scenegen.errors import RequestError
    from scenegen.errors.program import PUBLIC_ADDRESS, SERVED_IN_PUBLIC
    from scenegen.errors.requests import NOT_INSTALLED
    from scenegen.show.view.project import open_

    if host not in LOOPBACK and not public:
        raise RequestError(PUBLIC_ADDRESS(host=host))
    opened = open_(what)
    if export is not None:
        import shlex

        from scenegen.show.view.export import export_page

        name = shlex.quote(str(what) if what is not None else opened.name)
        command = f"scenegen view {name} --export {shlex.quote(export.name)} -n {n} --seed {seed}"
        size = export_page(opened, export, n, seed, command)
        print_error(f"wrote {export}, {size / 1e6:.1f} MB: open it in any browser")
        return 0
    try:
        from scenegen.show.view.serve import serve
    except ModuleNotFoundError as error:
        if error.name is None or error.name.split(".")[0] not in ("starlette", "uvicorn", "websockets", "h11"):
            raise
        command = 'pip install "scenegen[view]"; --export works without'
        raise RequestError(NOT_INSTALLED(package="starlette", purpose="for the page", command=command)) from None
    if host not in LOOPBACK:
        complain(SERVED_IN_PUBLIC(host=host))

    def told(link: str) -> None:
        print_error(f"{opened.name}: {link}")
        print_error("Ctrl-C ends it")
        if browser:
            import webbrowser

            webbrowser.open(link)

    return serve(opened, host, port, told)
