"""`scenegen grammar`: what a language model may say about a spec, as a context-free grammar."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from scenegen.cli.options import Root, find_spec, spec_names

if TYPE_CHECKING:
    from scenegen.api.spec import Spec


def grammar(
    spec: Annotated[
        Path | None,
        typer.Argument(
            help="A spec file, or the name of a shipped spec: its declarations are what the grammar is about.",
            metavar="[SPEC]",
            show_default=False,
            autocompletion=spec_names,
        ),
    ] = None,
    objects: Annotated[
        str | None,
        typer.Option("--objects", help="Objects instead of a spec: mug,plate.", metavar="NAMES", show_default=False),
    ] = None,
    to: Annotated[
        str, typer.Option("--to", help="lark and json are read by llguidance, gbnf by llama.cpp.", metavar="DIALECT")
    ] = "lark",
    shape: Annotated[
        str,
        typer.Option(
            "--shape",
            help="goals: labels that are possible each by itself; formulas: statements freely joined.",
            metavar="SHAPE",
        ),
    ] = "goals",
    only: Annotated[
        str,
        typer.Option(
            "--only", help="labels: leave out the declarations, which the model repeats otherwise.", metavar="PART"
        ),
    ] = "spec",
    out: Annotated[
        Path | None,
        typer.Option("--out", help="Write it into this file.", metavar="FILE", show_default=False),
    ] = None,
    root: Root = None,
) -> None:
    """Write the grammar that keeps a language model to valid specs.

    \b
      scenegen grammar table_setting --to gbnf --out table.gbnf
      scenegen grammar --objects mug,plate,fork --to json

    Objects, regions and relations are those of the spec, with the arguments and numbers that each can have. Whatever a
    model says in it passes `scenegen check`, except that with --shape formulas labels may contradict themselves.
    `scenegen explain language-models` says how to use it.
    """
    from scenegen.cli.output import print_error
    from scenegen.cli.streams import write_data
    from scenegen.editors.grammars.grammar import grammar_of
    from scenegen.scenes.files import check_writable, write_whole

    if out is not None:
        check_writable(out, *([spec] if spec is not None else []))
    data = grammar_of(_about(spec, objects, root), to, shape=shape, only=only).encode()
    if out is None:
        write_data(data)
        return
    write_whole(out, data)
    print_error(f"wrote {out}")


def _about(path: Path | None, objects: str | None, root: Path | None) -> Spec:
    """The spec that is meant. Raises RequestError where it is none or two."""
    from scenegen.api.spec import load
    from scenegen.editors.grammars.grammar import of_objects
    from scenegen.errors import RequestError
    from scenegen.errors.requests import OUT_OF_PLACE

    if path is not None and objects is not None:
        rule = "stands for a spec, and there is one"
        raise RequestError(OUT_OF_PLACE(option="--objects", rule=rule, remedy="give one of them"))
    if path is not None:
        return load(find_spec(path), root)
    if objects is None:
        rule, remedy = "is about a spec or objects, and there is neither", "name a spec, or `--objects mug,plate`"
        raise RequestError(OUT_OF_PLACE(option="a grammar", rule=rule, remedy=remedy))
    return of_objects([name.strip() for name in objects.split(",")])
