"""`scenegen fmt`: specs in canonical form."""

from __future__ import annotations

from pathlib import Path

from scenegen.cli.options import argument, option
from scenegen.cli.output import complain, print_error, write_data
from scenegen.errors import ScenegenError

STANDARD_INPUT = Path("-")


def fmt(
    specs: list[Path] = argument("Spec files; - is standard input.", "SPEC"),
    check: bool = option("Write nothing; exit status 1 if any file is not in canonical form."),
    diff: bool = option("Write nothing; print what would change."),
) -> int:
    """Rewrite specs in canonical form: comments and paragraphs stay, spacing and line breaks do not.

    \b
      scenegen fmt specs/*.spec
      scenegen fmt --check --diff my.spec
      scenegen fmt - < my.spec

    What a spec means never changes. A file in canonical form already is not touched; one with syntax errors is not
    either, and the exit status is then 1. With - the result goes to standard output.
    """
    failed = changes = False
    for path in specs:
        name = "<stdin>" if path == STANDARD_INPUT else str(path)
        try:
            before = _read(path)
            after = _format(name, before)
            if diff:
                _print_diff(name, before, after)
            elif not check:
                _write(path, before, after)
        except ScenegenError as error:
            complain(*error.diagnostics)
            failed = True
            continue
        if before != after:
            changes = True
            if check:
                print_error(f"would reformat {name}")
            elif not diff and path != STANDARD_INPUT:
                print_error(f"reformatted {name}")
    return int(failed or (check and changes))


def _read(path: Path) -> bytes:
    from scenegen.lang.syntax.parse import MAX_CHARACTERS
    from scenegen.scenes.files import read_bytes, read_stream

    read = read_stream if path == STANDARD_INPUT else read_bytes
    return read(path, "a spec", limit=4 * MAX_CHARACTERS)  # no character of UTF-8 takes more than four bytes


def _format(name: str, data: bytes) -> bytes:
    from scenegen.lang.syntax.parse import read_source
    from scenegen.lang.syntax.printer import format_source

    return format_source(read_source(name, data)).encode()


def _write(path: Path, before: bytes, after: bytes) -> None:
    from scenegen.scenes.files import write_whole

    if path == STANDARD_INPUT:
        write_data(after)
    elif before != after:
        mode = path.stat().st_mode
        write_whole(path, after)
        path.chmod(mode)


def _print_diff(name: str, before: bytes, after: bytes) -> None:
    """A unified diff on standard output, as `patch` and `git apply -p0` take it."""
    from difflib import unified_diff

    old, new = (data.decode().split("\n") for data in (before, after))
    lines = [f"{line}\n" for line in old[:-1]] + ([f"{old[-1]}\n\\ No newline at end of file\n"] if old[-1] else [])
    changes = unified_diff(lines, [f"{line}\n" for line in new[:-1]], name, name)
    write_data("".join(changes).encode())
