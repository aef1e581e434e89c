"""`scenegen train` of several specs: each training is a job of its own."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.cli.many import Said

if TYPE_CHECKING:
    from scenegen.api.spec import Spec
    from scenegen.errors import Diagnostic


Task = tuple[Path, Path, dict[str, int]]


def trainings(
    name: str, source: Path, folder: Path, root: Path | None, counts: dict[str, str]
) -> list[tuple[str, Task]]:
    """The jobs of a spec, by their names: one model, FOLDER/NAME.safetensors; or, where the spec draws how many things
    there are, a model for each combination of numbers, in FOLDER/NAME/."""
    from scenegen.api.family import family_files
    from scenegen.api.spec import load
    from scenegen.errors import ScenegenError
    from scenegen.lang.counts import written

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
    `api.train.train`; `seconds` is the time limit of each, infinite for none. With `resume` a model that is complete is
    left alone, a training that was broken off goes on, and one that had not begun begins. Raises what `api.train.train`
    raises."""

    model: str
    recipe: str
    options: dict[str, Any]
    card: bool
    resume: bool
    seconds: float
    log_dir: Path | None
    root: Path | None
    counts: dict[str, str]
    phi: tuple[str, ...] = ()

    def __call__(self, task: Task) -> Said:
        from scenegen.api.spec import load
        from scenegen.api.train import train
        from scenegen.evaluation.card import card_paths, check_card, write_card
        from scenegen.evaluation.faults import faults
        from scenegen.formats.files import check_writable
        from scenegen.sampling.request import parse_phi
        from scenegen.training.state import begun

        source, out, numbers = task
        began = time.monotonic()
        spec = load(source, self.root).with_counts({**self.counts, **numbers})
        check_writable(out, source)
        if self.card:
            check_card(out, source)
        going = self.resume and begun(out)
        wanted = parse_phi(self.phi, spec.labels)
        if going and self._complete(spec, out) and not (self.card and not card_paths(out)[0].exists()):
            return Said((f"complete already: {out}",))
        notes: list[Diagnostic] = []
        run = partial(
            train, spec, self.model, recipe=self.recipe, out=out, resume=going, on_note=notes.append, phi=wanted
        )
        log_dir = (
            None if self.log_dir is None else self.log_dir / (f"{source.stem}/{out.stem}" if numbers else out.stem)
        )
        limit = None if math.isinf(self.seconds) else self.seconds
        done = run(log_dir=log_dir, timeout=limit, **self.options)
        left = self.seconds - (time.monotonic() - began)
        if self.card and left > 0.0:
            write_card(done, out, left)
        took = f"{time.monotonic() - began:.0f} s"
        size = out.stat().st_size / 1e6
        return Said(
            (f"wrote {out} ({size:.2f} MB) in {took}",),
            (*notes, *faults(done.trained.card.quality, done.trained.card.ranges or ())),
        )

    def _complete(self, spec: Spec, out: Path) -> bool:
        """Whether a file is the model of this training after all its epochs."""
        from scenegen.api.train import trained_on
        from scenegen.errors import DataError
        from scenegen.models.checkpoint import load_model
        from scenegen.sampling.request import parse_phi
        from scenegen.training.config import make_config
        from scenegen.training.state import load_state, state_path

        if not state_path(out).exists():
            return False
        asked = trained_on(spec, parse_phi(self.phi, spec.labels))
        config = make_config(self.model, self.recipe, phi=asked, **self.options)
        if load_state(state_path(out), spec.checked, config).epoch < config.epochs:
            return False
        try:
            return load_model(out, spec.checked).card.epochs_done == config.epochs
        except DataError:
            return False
