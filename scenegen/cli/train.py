"""`scenegen train`: fit a model to a spec."""

from __future__ import annotations

import math
import time
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from scenegen.cli.options import Root, SpecFile


def _models(incomplete: str) -> list[str]:
    from scenegen.models.table import MODELS

    return [name for name in MODELS if name.startswith(incomplete)]


def train(
    spec: SpecFile,
    out: Annotated[Path, typer.Option("--out", help="The model file.", metavar="FILE", show_default=False)],
    model: Annotated[
        str,
        typer.Option("--model", help="energy, flow, gan or aae.", metavar="NAME", autocompletion=_models),
    ] = "energy",
    recipe: Annotated[
        str, typer.Option("--recipe", help="default, or paper: the published networks and settings (gan, aae).")
    ] = "default",
    epochs: Annotated[int | None, typer.Option("--epochs", help="Passes over the training scenes.")] = None,
    batch_size: Annotated[int | None, typer.Option("--batch-size", help="Scenes per step.")] = None,
    lr: Annotated[float | None, typer.Option("--lr", help="Learning rate of Adam.")] = None,
    scenes: Annotated[
        int | None, typer.Option("--scenes", help="Training scenes; of a file the first so many, all if left out.")
    ] = None,
    data: Annotated[
        str | None,
        typer.Option(
            "--data",
            help="balanced: exact, flat in phi; uniform; boosted: satisfying scenes perturbed to be more; or a file of "
            "scenes (.parquet of any size, .jsonl, .json).",
            metavar="NAME|FILE",
        ),
    ] = None,
    hyper: Annotated[
        list[str] | None,
        typer.Option(
            "--hyper",
            help="A setting of the model's own, such as width=128; repeat it for more. docs/models.md has them all.",
            metavar="NAME=VALUE",
        ),
    ] = None,
    patience: Annotated[
        int | None,
        typer.Option(
            "--patience",
            help="Stop after so many epochs without a smaller error of phi on held-out labels, and keep the best; left "
            "out, all epochs are run and the last is kept.",
            metavar="EPOCHS",
        ),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="Of everything random; the same seed gives the same model.")] = 0,
    device: Annotated[str, typer.Option("--device", help="cpu, cuda or cuda:1.")] = "cpu",
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from where an earlier run into --out stopped.")
    ] = False,
    log_dir: Annotated[
        Path | None,
        typer.Option("--log-dir", help="Write TensorBoard event files there.", metavar="DIR", show_default=False),
    ] = None,
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout",
            help="Seconds after which to stop; left out, there is no limit.",
            metavar="SEC",
            show_default=False,
        ),
    ] = None,
    card: Annotated[
        bool, typer.Option("--card/--no-card", help="Measure the model when it is done: FILE.md and FILE.png.")
    ] = True,
    root: Root = None,
) -> None:
    """Train a model that draws scenes for a wanted phi, and write it to one small file.

    \b
      scenegen train first --out m.safetensors
      scenegen train first --out m.safetensors --resume
      scenegen train my.spec --model flow --epochs 8 --out flow.safetensors
      scenegen sample m.safetensors --phi 0:0.2 -n 100 --out scenes.json

    What is left out is the recipe's. Ctrl-C leaves a usable model; --resume then goes on to the very result of an
    unbroken run (it reads FILE.train, which lies beside the model and may be deleted when you are done). With more
    --epochs than at first, the learning rate follows the new plan from there on.

    First the training scenes are gathered, which takes as long as such scenes are rare: how many there are is shown.
    When --timeout is over by then, nothing is written and the exit status is 1. Later, training stops as on Ctrl-C, the
    model is what it has come to, and no card is made.

    Some scenes beside the training scenes are held out; after each epoch the model is asked for their phi, and how far
    it is off is shown. The card, FILE.md, holds what the model is and how it compares with fresh exact scenes.
    """
    from scenegen.cli.output import console, detail, print_error
    from scenegen.formats.files import check_writable
    from scenegen.given import seconds
    from scenegen.needs import need
    from scenegen.training.config import make_config, parse_settings

    options: dict[str, Any] = {
        "epochs": epochs,
        "batch_size": batch_size,
        "lr": lr,
        "scenes": scenes,
        "data": data,
        "patience": patience,
        "hyper": parse_settings(hyper or []),
        "seed": seed,
        "device": device,
    }
    # refused before anything is read, loaded or drawn; the rest of the imports bring torch, which takes seconds
    config = make_config(model, recipe, **options)
    until = time.monotonic() + (math.inf if timeout is None else seconds("timeout", timeout))
    check_writable(out, spec)
    need("torch", "to train a model")
    from scenegen.api.card import check_card, write_card
    from scenegen.api.spec import load
    from scenegen.api.train import train as run
    from scenegen.training.progress import TrainingProgress

    if card:
        check_card(out, spec)
    checked = load(spec, root)
    detail(f"parsed and checked {spec}; training {config}")
    with TrainingProgress(config.epochs, model, console()) as progress:
        train_on = partial(run, checked, model, recipe=recipe, out=out, resume=resume, log_dir=log_dir, timeout=timeout)
        tell: dict[str, Any] = {"on_step": progress.step, "on_note": progress.note, "on_gather": progress.gather}
        done = train_on(on_epoch=progress, **tell, **options)
    detail("trained")
    left = until - time.monotonic()
    if card and left > 0.0:
        try:
            for path in write_card(done, out, left):
                print_error(f"wrote {path}")
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt(f"interrupted: {out} is complete, its card is not made") from error
    print_error(f"wrote {out} ({out.stat().st_size / 1e6:.2f} MB); try: scenegen sample {out} --phi ... -n 16")
