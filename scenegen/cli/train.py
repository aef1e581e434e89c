"""`scenegen train`: fit a model to a spec."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.many import JobMessages, folder_for, names_of, refuse_engine, shared_work
from scenegen.cli.options import ADDRESS, COUNT, ENGINE, ROOT, SPEC_FILES, asking, option, parse_counts, seconds
from scenegen.cli.output import complain, console, detail, flag, left, print_error
from scenegen.errors import DataError, RequestError, ScenegenError, render
from scenegen.errors.requests import NO_TIME_TO_CHECK
from scenegen.learn.training.config import TrainConfig, make_config, parse_settings
from scenegen.scenes.locations import names_set
from scenegen.validation import as_seconds

if TYPE_CHECKING:
    from scenegen.api.spec import Spec
    from scenegen.errors import Diagnostic
    from scenegen.sampling.problem import Budget


class Clock:
    """Where the seconds of a run went."""

    def __init__(self) -> None:
        self._marks = [time.monotonic()]

    def told(self, step: Callable[[int, int], None]) -> Callable[[int, int], None]:
        """`step`, at whose first call the scenes are there."""

        def first(done: int, total: int) -> None:
            if len(self._marks) == 1:
                self._marks.append(time.monotonic())
            step(done, total)

        return first

    def trained(self) -> None:
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
    from scenegen.sampling.problem import Budget

    options = {**typed, "hyper": parse_settings(typed["hyper"] or [])}
    model, phi = options.pop("model"), options.pop("phi")
    # refused before anything is read, loaded or drawn; the rest of the imports bring torch, which takes seconds
    config = make_config(model, **options)
    counts = parse_counts(count)
    budget = Budget(math.inf if timeout is None else left(as_seconds("timeout", timeout)))
    if len(specs) > 1 or names_set(out):
        from scenegen.scenes.files import ensure_folder

        folder = Path(folder_for(out, len(specs)))
        named = zip(names_of(specs), specs, strict=True)
        need("torch", "to train a model")
        ensure_folder(folder)
        jobs = [job for name, spec in named for job in trainings(name, spec, folder, root, counts)]
        job = Training(model, options, card, resume, budget, log_dir, root, counts, tuple(phi or ()))
        return shared_work(job, jobs, engine, workers, address, "training")
    refuse_engine(engine, address)
    from scenegen.errors.learning import FOLDER_OF_MODELS
    from scenegen.scenes.files import check_writable

    spec, path = specs[0], Path(out)
    check_writable(path)
    need("torch", "to train a model")
    from scenegen.api.spec import load
    from scenegen.learn.evaluation.card import check_card, write_card
    from scenegen.learn.faults import faults
    from scenegen.learn.train import train as run
    from scenegen.learn.training.progress import TrainingProgress
    from scenegen.sampling.request import parse_phi

    checked = load(spec, root).with_counts(counts)
    if card:
        check_card(path)
    if checked.counts:
        raise RequestError(FOLDER_OF_MODELS(file=str(spec), path=path, folder=path.with_suffix("")))
    wanted = parse_phi(phi or [], checked.labels)
    detail(f"parsed and checked {spec}; training {config}")
    clock = Clock()
    with TrainingProgress(config.epochs, model, console()) as progress:
        train_on = partial(run, checked, model, out=path, resume=resume, log_dir=log_dir, phi=wanted)
        tell: dict[str, Any] = {"on_step": clock.told(progress.step), "on_gather": progress.gather}
        tell["on_note"] = lambda note: progress.note(render(note, spell=flag))
        done = train_on(on_epoch=progress, timeout=timeout and budget.seconds_left, **tell, **options)
    detail("trained")
    clock.trained()
    if card and not budget.spent:
        try:
            for written in write_card(done, path, budget.seconds_left):
                print_error(f"wrote {written}")
        except KeyboardInterrupt as error:
            raise KeyboardInterrupt(f"interrupted: {out} is complete, its card is not made") from error
    complain(*faults(done.trained.card.quality, done.trained.card.ranges or ()))
    print_error(
        f"{clock}; wrote {out} ({path.stat().st_size / 1e6:.2f} MB); try: scenegen sample {out} --phi ... -n 16"
    )
    return 0


# `scenegen train` of several specs: each training is a job of its own.


Task = tuple[Path, Path, dict[str, int]]


def trainings(
    name: str, source: Path, folder: Path, root: Path | None, counts: dict[str, str]
) -> list[tuple[str, Task]]:
    """The jobs of a spec, by their names: one model, FOLDER/NAME.safetensors; or, where the spec draws how many things
    there are, a model for each combination of numbers, in FOLDER/NAME/."""
    from scenegen.api.spec import load
    from scenegen.lang.spec import written
    from scenegen.learn.model import family_files

    one: Task = (source, folder / f"{name}.safetensors", {})
    try:
        spec = load(source, root).with_counts(counts)
    except ScenegenError:  # its job says what is wrong
        return [(name, one)]
    if not spec.counts:
        return [(name, one)]
    return [
        (f"{name} with {written(numbers)}", (source, file, {key: int(number) for key, number in numbers.items()}))
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

    def __call__(self, task: Task) -> JobMessages:
        if self.budget.spent:
            raise RequestError(NO_TIME_TO_CHECK())
        from scenegen.api.spec import load
        from scenegen.learn.evaluation.card import card_paths, check_card, write_card
        from scenegen.learn.faults import faults
        from scenegen.learn.train import train
        from scenegen.learn.training.state import can_resume
        from scenegen.sampling.request import parse_phi
        from scenegen.scenes.files import check_writable

        source, out, numbers = task
        began = time.monotonic()
        spec = load(source, self.root).with_counts({**self.counts, **numbers})
        check_writable(out, source)
        if self.card:
            check_card(out, source)
        going = self.resume and can_resume(out)
        wanted = parse_phi(self.phi, spec.labels)
        if going and self._complete(spec, out) and not (self.card and not card_paths(out)[0].exists()):
            return JobMessages((f"complete already: {out}",))
        notes: list[Diagnostic] = []
        run = partial(train, spec, self.model, out=out, resume=going, on_note=notes.append, phi=wanted)
        log_dir = (
            None if self.log_dir is None else self.log_dir / (f"{source.stem}/{out.stem}" if numbers else out.stem)
        )
        left = self.budget.seconds_left
        done = run(log_dir=log_dir, timeout=None if math.isinf(left) else left, **self.options)
        if self.card and not self.budget.spent:
            write_card(done, out, self.budget.seconds_left)
        took = f"{time.monotonic() - began:.0f} s"
        size = out.stat().st_size / 1e6
        return JobMessages(
            (f"wrote {out} ({size:.2f} MB) in {took}",),
            (*notes, *faults(done.trained.card.quality, done.trained.card.ranges or ())),
        )

    def _complete(self, spec: Spec, out: Path) -> bool:
        """Whether a file is the model of this training after all its epochs."""
        from scenegen.learn.models.checkpoint import load_model
        from scenegen.learn.train import trained_on
        from scenegen.learn.training.state import load_state, state_path
        from scenegen.sampling.request import parse_phi

        if not state_path(out).exists():
            return False
        asked = trained_on(spec, parse_phi(self.phi, spec.labels))
        config = make_config(self.model, phi=asked, **self.options)
        if load_state(state_path(out), spec.checked, config).epoch < config.epochs:
            return False
        try:
            return load_model(out, spec.checked).card.epochs_done == config.epochs
        except DataError:
            return False
