"""The whole road once, as `make demo` runs it: exact scenes from a spec, drawn at once; then one trained model, its
scenes, and their pictures.

Everything lands in the folder demo-out. Fewer scenes and epochs than `scenegen train` takes by default keep it short.
"""

import argparse
import time
from collections.abc import Mapping
from pathlib import Path

from rich.console import Console
from rich.table import Table

import scenegen

ROOT = Path(__file__).resolve().parent.parent
Ranges = Mapping[str, tuple[float | None, float | None]]
SOLVED: Ranges = {"task": (0.0, None), "shared": (0.0, None)}
CLOSE: Ranges = {"task": (0.05, 0.2), "safe": (0.0, None)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=ROOT / "demo-out")
    parser.add_argument("--quick", action="store_true", help=argparse.SUPPRESS)  # as small as it gets, for the tests
    options = parser.parse_args()
    options.out.mkdir(exist_ok=True)
    n, size, workers, epochs, scenes = (2, (64, 48), 1, 1, 1_000) if options.quick else (16, None, None, 3, 40_000)
    console = Console()
    started = time.perf_counter()

    exact = exact_scenes(console, n)
    (sheet,) = exact.figures(options.out / "exact", "sheet", size=size, workers=workers)
    written = [sheet, exact.save(options.out / "exact" / "scenes.json")]
    console.print(
        f"After {time.perf_counter() - started:.0f} s, the pictures: {sheet}\n", soft_wrap=True, highlight=False
    )

    trained = model_scenes(console, options.out / "flow.safetensors", n, epochs, scenes)
    (sheet,) = trained.figures(options.out / "model", "sheet", size=size, workers=workers)
    written += [sheet, trained.save(options.out / "model" / "scenes.json"), options.out / "flow.safetensors"]

    console.print(f"\nDone in {time.perf_counter() - started:.0f} s. Open:")
    words = ("exact scenes", "their poses", "the model's scenes", "their poses", "the model")
    for path, what in zip(written, words, strict=True):
        console.print(f"  {path}  ({what})", soft_wrap=True, highlight=False)


def exact_scenes(console: Console, n: int) -> scenegen.SceneSet:
    """Scenes straight from a spec, without training."""
    spec = scenegen.load(ROOT / "specs" / "dinner_for_two.spec")
    console.print(f"[bold]1. Exact scenes.[/bold] {spec.checked.title}")
    scenes = scenegen.sample(spec, phi=SOLVED, n=n, seed=0)
    digits = int(-scenes.header.sampler["log10_probability"])
    console.print(f"{n} scenes that satisfy it. Of random scenes, fewer than 1 in {10**digits:,} do.")
    return scenes


def model_scenes(console: Console, file: Path, n: int, epochs: int, scenes: int) -> scenegen.SceneSet:
    """Scenes from a model that is trained for a moment."""
    from scenegen.learn.training.progress import TrainingProgress  # torch takes its time: the pictures came first

    spec = scenegen.load(ROOT / "specs" / "mug_left_of_plate.spec")
    console.print(f"[bold]2. A trained model.[/bold] {spec.checked.title}")
    with TrainingProgress(epochs, "flow", console) as progress:
        model = scenegen.train(spec, "flow", out=file, epochs=epochs, scenes=scenes, on_epoch=progress)
    drawn = scenegen.sample(model, CLOSE, n=n, seed=0)
    table = Table("label", "target phi", "lowest", "mean", "highest")
    for label, values in drawn.phi.items():
        low, high = CLOSE[label]
        target = f"{low:g}:" if high is None else f"{low:g}:{high:g}"
        table.add_row(label, target, *(f"{value:+.3f}" for value in (values.min(), values.mean(), values.max())))
    console.print(table)
    return drawn


if __name__ == "__main__":
    main()
