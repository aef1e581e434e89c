"""`scenegen train`: fit a model to a spec."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scenegen.cli.options import Root


def train(
    spec: Annotated[Path, typer.Argument(help="A spec file.", metavar="SPEC", show_default=False)],
    model: Annotated[str, typer.Option("--model", help="gan or aae.", metavar="NAME", show_default=False)],
    out: Annotated[Path, typer.Option("--out", help="The model file.", metavar="FILE", show_default=False)],
    epochs: Annotated[int, typer.Option("--epochs", help="Passes over the training scenes.")] = 50,
    batch_size: Annotated[int, typer.Option("--batch-size", help="Scenes per step.")] = 32,
    lr: Annotated[float, typer.Option("--lr", help="Learning rate of Adam.")] = 1e-3,
    scenes: Annotated[int, typer.Option("--scenes", help="Training scenes.")] = 20_000,
    data: Annotated[
        str, typer.Option("--data", help="uniform, or boosted: satisfying scenes perturbed to be more.")
    ] = "uniform",
    seed: Annotated[int, typer.Option("--seed", help="Of everything random; the same seed gives the same model.")] = 0,
    device: Annotated[str, typer.Option("--device", help="cpu, cuda or cuda:1.")] = "cpu",
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from where an earlier run into --out stopped.")
    ] = False,
    root: Root = None,
) -> None:
    """Train a model that draws scenes for a wanted phi, and write it to one small file.

    \b
      scenegen train specs/first.spec --model gan --out m.safetensors
      scenegen train specs/first.spec --model gan --out m.safetensors --resume
      scenegen sample m.safetensors --phi 0:0.2 -n 100 --out scenes.json

    The defaults are the paper's. Ctrl-C leaves a usable model; --resume then goes on to the very result of an unbroken
    run (it reads FILE.train, which lies beside the model and may be deleted when you are done).
    """
    from scenegen.api.spec import load
    from scenegen.api.train import train as run
    from scenegen.cli.output import console, print_error
    from scenegen.formats.files import check_writable
    from scenegen.training.config import TrainConfig
    from scenegen.training.progress import TrainingProgress

    check_writable(out, spec)
    checked = load(spec, root)
    options = {"epochs": epochs, "batch_size": batch_size, "lr": lr, "scenes": scenes, "data": data, "seed": seed}
    TrainConfig(model=model, device=device, **options)  # type: ignore[arg-type]  # refused before the bar appears
    with TrainingProgress(epochs, model, console()) as progress:
        run(checked, model, out=out, resume=resume, on_epoch=progress, on_note=progress.note, device=device, **options)
    print_error(f"wrote {out} ({out.stat().st_size / 1e6:.2f} MB); try: scenegen sample {out} --phi ... -n 16")
