"""Training: fit a model to a spec."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from scenegen.api.spec import Spec, check_spec
from scenegen.errors import Diagnostic, RequestError
from scenegen.errors.learning import FOLDER_OF_MODELS
from scenegen.errors.requests import NO_TIME_TO_CHECK
from scenegen.lang.spec import numbers_text
from scenegen.learn.model import Model, ModelFamily, family_files
from scenegen.needs import need
from scenegen.search.effort import effort_until as ends_at
from scenegen.validation import as_path, as_seconds

if TYPE_CHECKING:
    from scenegen.api.request import Phi
    from scenegen.learn.training.session import EpochReport


def train(
    spec: Spec,
    model: str = "flow",
    *,
    out: str | Path,
    resume: bool = False,
    log_dir: str | Path | None = None,
    card: bool = False,
    on_epoch: Callable[[EpochReport], None] | None = None,
    on_step: Callable[[int, int], None] | None = None,
    on_note: Callable[[Diagnostic], None] | None = None,
    on_gather: Callable[[str, int, int], None] | None = None,
    timeout: float | None = None,
    phi: Phi | None = None,
    **options: Any,
) -> Model:
    """Train a model of the table (flow, gan, aae, any) on a spec and write it to `out`.

    `options` are the fields of `scenegen.learn.training.config.TrainConfig`: epochs, batch_size, lr, seed, scenes,
    data, patience, device, hyper; the model's defaults where they are left out. `phi` says where to train, with ranges
    as `sample` has them: most of the training scenes lie there. `resume` goes on from the state that an earlier run
    left in `out`.train, to the same result as one run without a break, or from the scenes that it had gathered, in
    `out`.scenes. `log_dir` gets TensorBoard event files. `card` writes the model card, `out`.md and `out`.png, when
    training is done. `on_epoch` gets an EpochReport, `on_step` the steps that are done and planned, `on_note` a
    Diagnostic with what is worth knowing, `on_gather`, before the first epoch, what is being done and how many of how
    many training scenes are there.

    A label that no scene satisfies, or that has the same phi in every scene, is refused before any work is done, where
    bounds prove it (unless the scenes come from a file).

    After `timeout` seconds the gathering of scenes is given up: RequestError; those that are there are kept in
    `out`.scenes for `resume`. Training stops there after the step under way: the model is what it has come to, `resume`
    goes on, and no card is written.

    Of a spec that draws how many things there are, `out` is a folder: it gets a model for each combination of numbers,
    trained one after another, and `timeout` is for all of them.

    Raises RequestError, DataError, OutputError; Interrupted on Ctrl-C and SIGTERM, KeyboardInterrupt while scenes are
    gathered.
    """
    from scenegen.api.feasibility import refuse_infeasible
    from scenegen.learn.training.config import is_file, make_config

    check_spec(spec)
    path = as_path("out", out)
    logs = None if log_dir is None else as_path("log_dir", log_dir)
    seconds = math.inf if timeout is None else as_seconds("timeout", timeout)
    until = time.monotonic() + seconds

    def fit(one: Spec, file: Path, resume: bool, logs: Path | None) -> Model:
        """Train the model of a spec that draws no numbers."""
        if time.monotonic() >= until:
            raise RequestError(NO_TIME_TO_CHECK())
        config = make_config(model, phi=trained_on(one, phi, on_note), **options)
        need("torch", "to train a model")
        from scenegen.learn.training.loop import train as run

        if not is_file(config.data):
            refuse_infeasible(one.checked, ends_at(until))
        if card:
            from scenegen.learn.evaluation.card import check_card, write_card

            check_card(file)
        done = Model(
            run(
                one.checked,
                config,
                file,
                resume=resume,
                log_dir=logs,
                on_epoch=on_epoch,
                on_step=on_step,
                on_note=on_note,
                on_gather=on_gather,
                timeout=seconds,
                until=until,
            )
        )
        if card and time.monotonic() < until:
            write_card(done, file, until - time.monotonic())
        return done

    if not spec.counts:
        return fit(spec, path, resume, logs)
    if path.suffix.lower() == ".safetensors":
        raise RequestError(FOLDER_OF_MODELS(file=spec.definition.name, path=path, folder=path.with_suffix("")))
    from scenegen.learn.training.state import can_resume

    members: dict[str, Model] = {}
    for numbers, member, file in family_files(spec, path):
        try:
            members[member.checked.sha256] = fit(
                member, file, resume and can_resume(file), None if logs is None else logs / file.stem
            )
        except RequestError as error:
            raise RequestError(*(one.but(counted=numbers_text(numbers)) for one in error.diagnostics)) from None
    return ModelFamily(spec, members)


def trained_on(
    spec: Spec, phi: Phi | None, on_note: Callable[[Diagnostic], None] | None = None
) -> dict[str, str] | None:
    """The ranges as a training's settings have them. Raises RequestError for those that `sample` refuses."""
    from scenegen.api.request import read_phi
    from scenegen.sampling.problem import make_problem
    from scenegen.sampling.request import SampleRequest

    wanted = read_phi(spec, phi)
    if not wanted:
        return None
    problem = make_problem(spec.checked, SampleRequest(wanted, 1))
    if on_note is not None:
        for warning in problem.warnings:
            on_note(warning)
    return {label: str(one) for label, one in problem.request.phi.items()}
