"""`scenegen grammar`: what a language model may say about a spec, as a context-free grammar."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scenegen.cli.options import ROOT, argument, find_spec, option, spec_names
from scenegen.cli.output import print_error, write_data
from scenegen.errors import RequestError
from scenegen.errors.requests import OUT_OF_PLACE

if TYPE_CHECKING:
    from scenegen.api.spec import Spec


def grammar(
    spec: Path | None = argument(
        "A spec file, or the name of a shipped spec: its declarations are what the grammar is about.",
        "[SPEC]",
        default=None,
        autocompletion=spec_names,
    ),
    objects: str | None = option("Objects instead of a spec: mug,plate.", "NAMES"),
    to: str = option("lark and json are read by llguidance, gbnf by llama.cpp.", "DIALECT", default="lark"),
    shape: str = option(
        "goals: labels that are possible each by itself; formulas: statements freely joined.", "SHAPE", default="goals"
    ),
    only: str = option(
        "labels: leave out the declarations, which the model repeats otherwise.", "PART", default="spec"
    ),
    out: Path | None = option("Write it into this file.", "FILE"),
    root: Path | None = ROOT,
) -> None:
    """Write the grammar that keeps a language model to valid specs.

    \b
      scenegen grammar table_setting --to gbnf --out table.gbnf
      scenegen grammar --objects mug,plate,fork --to json

    Objects, regions and relations are those of the spec, with the arguments and numbers that each can have. Whatever a
    model says in it passes `scenegen check`, except that with --shape formulas labels may contradict themselves.
    `scenegen explain language-models` says how to use it.
    """
    from scenegen.editors.grammars.grammar import grammar_of
    from scenegen.scenes.files import check_writable, write_whole

    if out is not None:
        check_writable(out)
    data = grammar_of(_spec_of(spec, objects, root), to, shape=shape, only=only).encode()
    if out is None:
        write_data(data)
        return
    write_whole(out, data)
    print_error(f"wrote {out}")


def _spec_of(path: Path | None, objects: str | None, root: Path | None) -> Spec:
    """The spec that is meant. Raises RequestError where it is none or two."""
    from scenegen.api.spec import load
    from scenegen.editors.grammars.grammar import of_objects

    if path is not None and objects is not None:
        rule = "stands for a spec, and there is one"
        raise RequestError(OUT_OF_PLACE(option="--objects", rule=rule, remedy="give one of them"))
    if path is not None:
        return load(find_spec(path), root)
    if objects is None:
        rule, remedy = "is about a spec or objects, and there is neither", "name a spec, or `--objects mug,plate`"
        raise RequestError(OUT_OF_PLACE(option="a grammar", rule=rule, remedy=remedy))
    return of_objects([name.strip() for name in objects.split(",")])
