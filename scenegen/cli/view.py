"""`scenegen view`: write a spec and see its scenes while typing."""

from __future__ import annotations

from pathlib import Path

from scenegen.cli.options import argument, option

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
    from scenegen.cli.output import complain, print_error
    from scenegen.errors import RequestError
    from scenegen.errors.program import PUBLIC_ADDRESS, SERVED_IN_PUBLIC
    from scenegen.errors.requests import NOT_INSTALLED
    from scenegen.show.view.opened import open_

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
