"""`scenegen info`: what a model file is."""

from __future__ import annotations

from pathlib import Path

import typer

from scenegen.cli.options import JSON, argument
from scenegen.cli.output import print_json


def info(
    model: Path = argument(
        "A model file, or a folder of models, as `scenegen train` writes them; `any`: the model of any spec.", "MODEL"
    ),
    json: bool = JSON,
) -> None:
    """Say what a model file is: its spec, what it was trained on and how, how good it is, and how fast.

    \b
      scenegen info m.safetensors
      scenegen info m.safetensors --json | jq .validation.errors
      scenegen info any

    "held-out phi" is how far the phi of its scenes is from what was wanted, at labels that it was not trained on. The
    model card FILE.md, which `scenegen train` writes beside the model, compares it with exact scenes, too. The speed is
    that of the network on one core of this machine; refining and verifying come to that. Of a folder each model is
    described.
    """
    from scenegen.learn.evaluation.describe import as_json, describe, speed
    from scenegen.learn.model import ANY, load_model, model_file

    if str(model) == ANY:
        _print_any(json)
        return
    found = load_model(model)
    each = [(model_file(model, numbers), one) for numbers, one in found.members]
    if json:
        told = [as_json(one, path) for path, one in each]
        print_json({"models": told} if found.spec.counts else told[0])
        return
    for path, one in each:
        facts = [
            *describe(one, path),
            ("speed", f"about {float(f'{speed(one):.2g}'):,.0f} scenes a second on one core"),
        ]
        typer.echo(f"{path}: {one.trained.card.spec.title or one.trained.card.spec.name}\n")
        width = max(len(name) for name, _ in facts)
        for name, value in facts:
            typer.echo(f"  {name:<{width}}  {value}")
        typer.echo("")
    typer.echo("its spec:\n")
    typer.echo("\n".join(f"  {line}".rstrip() for line in found.spec.source.splitlines()))


def _print_any(json: bool) -> None:
    """What the model of any spec is, of none in particular."""
    from scenegen.needs import need

    need("torch", "to read a model")
    from scenegen.learn.any import ANY_SCOPE
    from scenegen.learn.models.graph_flow import WEIGHTS, shipped_weights

    card, weights = shipped_weights()
    size, count = WEIGHTS.stat().st_size, sum(one.numel() for one in weights.values())
    if json:
        print_json({"bytes": size, "weights": count, **card.model_dump()})
        return
    facts = {
        "networks": ", ".join(f"{name} {value}" for name, value in card.hyper.items()),
        "file": f"{size:,} bytes, {count:,} weights",
        "learnt from": f"{card.specs:,} random specs, {card.steps:,} steps, {card.cpu_hours:g} CPU hours",
        **ANY_SCOPE,
        **card.figures,
    }
    typer.echo("any: the model of any spec, a flow over the graph of its formula\n")
    width = max(map(len, facts))
    for name, value in facts.items():
        typer.echo(f"  {name:<{width}}  {value}")
