"""`scenegen train`: fit a model to a spec."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from scenegen.cli.many import JobMessages, folder_for, names_of, refuse_engine, shared_work
from scenegen.cli.options import ADDRESS, COUNT, ENGINE, ROOT, SPEC_FILES, asking, option, parse_counts, seconds
from scenegen.cli.output import complain, console, detail, flag, print_error, time_left
from scenegen.errors import DataError, RequestError, ScenegenError, render
from scenegen.errors.requests import NO_TIME_TO_CHECK
from scenegen.learn.training.config import TrainConfig, make_config, parse_settings
from scenegen.scenes.locations import names_set
from scenegen.validation import as_seconds

if TYPE_CHECKING:
    from scenegen.api.spec import Spec
    from scenegen.errors import Diagnostic
    from scenegen.learn.model import Model
    from scenegen.sampling.request import Range
    from scenegen.search.effort import Budget


class Clock:
    """Where the seconds of a run went."""

    def __init__(self) -> None:
        self._marks = [time.monotonic()]

    def mark_first_step(self, step: Callable[[int, int], None]) -> Callable[[int, int], None]:
        """`step`, at whose first call the scenes are there."""

        def first(done: int, total: int) -> None:
            if len(self._marks) == 1:
                self._marks.append(time.monotonic())
            step(done, total)

        return first

    def mark_trained(self) -> None:
        """The model is done; the rest is its card."""
        self._marks.append(time.monotonic())

    def __str__(self) -> str:
        *_, before, trained = marks = self._marks
        now = time.monotonic()
        parts = [("gathering", before - marks[0]), ("training", trained - before), ("card", now - trained)]
        told = ", ".join(f"{name} {seconds:.0f} s" for name, seconds in parts if seconds >= 0.5)
        return f"{now - marks[0]:.0f} s in all" + (f" ({told})" if told else "")


@asking(TrainConfig, model="flow")
def train(
    specs: list[Path] = SPEC_FILES,
    out: str = option(
        "The model file; of several specs, or of one that draws numbers, DIR/ for a model of each name.",
        "FILE|DIR/",
        default=...,
    ),
    resume: bool = option("Go on from where an earlier run into --out stopped."),
    log_dir: Path | None = option("Write TensorBoard event files there.", "DIR"),
    timeout: float | None = option(
        "Seconds after which to stop; left out, there is no limit.", "SECONDS", parser=seconds
    ),
    card: bool = option(
        "Measure the model when it is done: FILE.md and FILE.png.", flags="--card/--no-card", default=True
    ),
    engine: str = ENGINE,
    address: str | None = ADDRESS,
    workers: int | None = option("Models that are trained at a time; default: one per core."),
    count: list[str] | None = COUNT,
    root: Path | None = ROOT,
    **typed: Any,
) -> int:
    """Train a model that draws scenes for a wanted phi, and write it to one small file.

    \b
      scenegen train first --out m.safetensors
      scenegen train first --out m.safetensors --resume
      scenegen train my.spec --model flow --epochs 8 --out flow.safetensors
      scenegen train my.spec --phi task=-0.05:0.05 --out near.safetensors
      scenegen sample m.safetensors --phi 0:0.2 -n 100 --out scenes.json
      scenegen train specs/*.spec --out models/

    Unspecified options take the model's defaults. Ctrl-C leaves a usable model; --resume then continues to the same
    result as an uninterrupted run (it reads FILE.train beside the model, which you can delete afterwards). With more
    --epochs than at first, the learning rate follows the new schedule from there on.

    First the training scenes are drawn; where they are rare, there are fewer, and a note says so: this takes two
    minutes of CPU time at most. Those that are there when Ctrl-C, a signal or --timeout ends it are kept for --resume;
    after --timeout the exit status is 1. Later, training stops as on Ctrl-C: the current model is written, without a
    card.

    Some scenes are held out from training; after each epoch the model generates scenes for their phi, and the error is
    shown. The card, FILE.md, describes the model and compares it with new exact scenes.

    Several specs are trained side by side, by --engine; one that fails is reported by its name, the others are trained,
    and the exit status is 1. With --resume complete models are left alone, and the others go on. A spec that draws how
    many things there are gets a model for each number, in DIR/NAME/, which `sample` takes as a model.
    """
    from scenegen.needs import need
    from scenegen.search.effort import Budget

    options = {**typed, "hyper": parse_settings(typed["hyper"] or [])}
    model, phi = options.pop("model"), options.pop("phi")
    # refused before anything is read, loaded or drawn; the rest of the imports bring torch, which takes seconds
    config = make_config(model, **options)
    counts = parse_counts(count)
    budget = Budget(math.inf if timeout is None else time_left(as_seconds("timeout", timeout)))
    training = Training(model, options, card, resume, budget, log_dir, root, counts, tuple(phi or ()))
    if len(specs) > 1 or names_set(out):
        from scenegen.scenes.files import ensure_folder

        folder = Path(folder_for(out, len(specs)))
        named = zip(names_of(specs), specs, strict=True)
        need("torch", "to train a model")
        ensure_folder(folder)
        jobs = [job for name, spec in named for job in trainings(name, spec, folder, root, counts)]
        return shared_work(training, jobs, engine, workers, address, "training")
    refuse_engine(engine, address)
    from scenegen.errors.learning import FOLDER_OF_MODELS
    from scenegen.scenes.files import check_writable

    spec, path = specs[0], Path(out)
    check_writable(path)
    need("torch", "to train a model")
    from scenegen.learn.training.progress import TrainingProgress

    checked, wanted = training.prepare(spec, path)
    if checked.counts:
        raise RequestError(FOLDER_OF_MODELS(file=str(spec), path=path, folder=path.with_suffix("")))
    detail(f"parsed and checked {spec}; training {config}")
    clock = Clock()
    with TrainingProgress(config.epochs, model, console()) as progress:
        tell: dict[str, Any] = {"on_step": clock.mark_first_step(progress.step), "on_gather": progress.gather}
        tell["on_note"] = lambda note: progress.note(render(note, spell=flag))
        done = training.fit(checked, path, wanted, resume, log_dir, on_epoch=progress, **tell)
    detail("trained")
    clock.mark_trained()
    try:
        written, faults = training.finish(done, path)
    except KeyboardInterrupt as error:
        raise KeyboardInterrupt(f"interrupted: {out} is complete, its card is not made") from error
    for file in written:
        print_error(f"wrote {file}")
    complain(*faults)
    print_error(
        f"{clock}; wrote {out} ({path.stat().st_size / 1e6:.2f} MB); try: scenegen sample {out} --phi ... -n 16"
    )
    return 0


Task = tuple[Path, Path, dict[str, int]]


def trainings(
    name: str, source: Path, folder: Path, root: Path | None, counts: dict[str, str]
) -> list[tuple[str, Task]]:
    """The jobs of a spec, by their names: one model, FOLDER/NAME.safetensors; or, where the spec draws how many things
    there are, a model for each combination of numbers, in FOLDER/NAME/."""
    from scenegen.api.spec import load
    from scenegen.lang.spec import numbers_text
    from scenegen.learn.model import family_files

    one: Task = (source, folder / f"{name}.safetensors", {})
    try:
        spec = load(source, root).with_counts(counts)
    except ScenegenError:  # its job says what is wrong
        return [(name, one)]
    if not spec.counts:
        return [(name, one)]
    return [
        (f"{name} with {numbers_text(numbers)}", (source, file, {key: int(number) for key, number in numbers.items()}))
        for numbers, _, file in family_files(spec, folder / name)
    ]


@dataclass(frozen=True, slots=True)
class Training:
    """The job of one model among several: spec file, model file, numbers of things. `options` are those of
    `api.train.train`; `budget` is the time limit of all, infinite for none. With `resume` a model that is complete is
    left alone, a training that was broken off goes on, and one that had not begun begins. Raises what `api.train.train`
    raises."""

    model: str
    options: dict[str, Any]
    card: bool
    resume: bool
    budget: Budget
    log_dir: Path | None
    root: Path | None
    counts: dict[str, str]
    phi: tuple[str, ...] = ()

    def prepare(
        self, source: Path, out: Path, numbers: Mapping[str, int] = MappingProxyType({})
    ) -> tuple[Spec, dict[str, Range]]:
        """The spec, with these numbers of things, and the ranges of --phi; there is a place for the model and card."""
        from scenegen.api.spec import load
        from scenegen.learn.evaluation.card import check_card
        from scenegen.sampling.request import parse_phi
        from scenegen.scenes.files import check_writable

        spec = load(source, self.root).with_counts({**self.counts, **numbers})
        check_writable(out, source)
        if self.card:
            check_card(out, source)
        return spec, parse_phi(self.phi, spec.labels)

    def fit(
        self, spec: Spec, out: Path, wanted: Mapping[str, Range], resume: bool, log_dir: Path | None, **watching: Any
    ) -> Model:
        """Train; `watching` are the callbacks of `api.train.train`."""
        from scenegen.learn.train import train

        left = self.budget.seconds_left
        return train(
            spec, self.model, out=out, resume=resume, log_dir=log_dir, phi=wanted,
            timeout=None if math.isinf(left) else left, **watching, **self.options,
        )  # fmt: skip

    def finish(self, done: Model, out: Path) -> tuple[list[Path], list[Diagnostic]]:
        """Write the card, where one is wanted and there is time: its files, and what is wrong with the model."""
        from scenegen.learn.evaluation.card import write_card
        from scenegen.learn.faults import faults

        files = write_card(done, out, self.budget.seconds_left) if self.card and not self.budget.is_spent else []
        return files, faults(done.trained.card.quality, done.trained.card.ranges or ())

    def __call__(self, task: Task) -> JobMessages:
        if self.budget.is_spent:
            raise RequestError(NO_TIME_TO_CHECK())
        from scenegen.learn.evaluation.card import card_paths
        from scenegen.learn.training.state import can_resume

        source, out, numbers = task
        started = time.monotonic()
        spec, wanted = self.prepare(source, out, numbers)
        going = self.resume and can_resume(out)
        if going and self._complete(spec, out, wanted) and not (self.card and not card_paths(out)[0].exists()):
            return JobMessages((f"complete already: {out}",))
        notes: list[Diagnostic] = []
        place = f"{source.stem}/{out.stem}" if numbers else out.stem
        log_dir = None if self.log_dir is None else self.log_dir / place
        done = self.fit(spec, out, wanted, going, log_dir, on_note=notes.append)
        _, faults = self.finish(done, out)
        size, took = out.stat().st_size / 1e6, time.monotonic() - started
        return JobMessages((f"wrote {out} ({size:.2f} MB) in {took:.0f} s",), (*notes, *faults))

    def _complete(self, spec: Spec, out: Path, wanted: Mapping[str, Range]) -> bool:
        """Whether a file is the model of this training after all its epochs."""
        from scenegen.learn.models.checkpoint import load_model
        from scenegen.learn.train import trained_on
        from scenegen.learn.training.state import load_state, state_path

        if not state_path(out).exists():
            return False
        asked = trained_on(spec, dict(wanted))
        config = make_config(self.model, phi=asked, **self.options)
        if load_state(state_path(out), spec.checked, config).epoch < config.epochs:
            return False
        try:
            return load_model(out, spec.checked).card.epochs_done == config.epochs
        except DataError:
            return False
