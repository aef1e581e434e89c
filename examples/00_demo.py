"""The whole road once, as `make demo` runs it: train a GAN, an AAE and an energy-score generator, sample 16 scenes from
each, draw them.

Everything lands in the folder demo-out. Fewer scenes and epochs than `scenegen train` takes by default keep it short.
"""

import argparse
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

import scenegen
from scenegen.training.progress import TrainingProgress

ROOT = Path(__file__).resolve().parent.parent
PHI = {"task": (0.05, 0.2), "safe": (0.0, None)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--epochs", type=int, default=4)
    parser.add_argument("--scenes", type=int, default=60_000)
    parser.add_argument("-n", type=int, default=16, help="scenes of each model")
    parser.add_argument("--out", type=Path, default=ROOT / "demo-out")
    options = parser.parse_args()
    options.out.mkdir(exist_ok=True)
    console = Console()
    started = time.perf_counter()

    spec = scenegen.load(ROOT / "specs" / "mug_left_of_plate.spec")
    console.print(f"[bold]{spec.checked.title}[/bold]\n{spec.source}")
    table = Table("model", "label", "asked phi", "lowest", "mean", "highest", title="What was asked for, what came out")
    written = []
    for name in ("gan", "aae", "energy"):
        with TrainingProgress(options.epochs, name, console) as progress:
            file = options.out / f"{name}.safetensors"
            model = scenegen.train(
                spec, name, out=file, epochs=options.epochs, scenes=options.scenes, on_epoch=progress
            )
        scenes = scenegen.sample(model, PHI, n=options.n, seed=0)
        path = scenes.save(options.out / f"{name}.json")
        with console.status(f"drawing the scenes of the {name}"):
            drawn = scenes.render(options.out / f"{name}-pictures")
        written += [file, path, drawn.sheet]
        for label, values in scenes.phi.items():
            low, high = PHI[label]
            asked = f"{low:g}:" if high is None else f"{low:g}:{high:g}"
            table.add_row(
                name, label, asked, *(f"{value:+.3f}" for value in (values.min(), values.mean(), values.max()))
            )
    console.print(table)
    console.print(f"\nDone in {time.perf_counter() - started:.0f} s. Look at:")
    for path in written:
        console.print(f"  {path}", soft_wrap=True, highlight=False)


if __name__ == "__main__":
    main()
