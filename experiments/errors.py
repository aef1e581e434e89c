"""Kinds of problems that only experiments have."""

from __future__ import annotations

from scenegen.errors import Diagnostic, Kind
from scenegen.errors.requests import NOT_INSTALLED

CHANGED_RECORD = Kind(
    "changed-record",
    "{path} is missing or was changed while it was in use",
    help="run the experiment again",
)
CANNOT_REPLACE_TABLES = Kind(
    "cannot-replace-tables",
    "cannot read {path}, whose tables were to be replaced",
    help="move it away and run the experiment again; the numbers are in {name}.json",
)
NOT_A_QUICK_RUN = Kind(
    "not-a-quick-run",
    "{path} is the report of a run that was not quick",
    help="give --quick another folder",
)
GRID_TASK = Kind("grid-task", "{problem}", help="{remedy}")
OTHER_TRAINING_DATA = Kind(
    "other-training-data",
    "the training data of {model} cannot be made as they were",
    help="another version of scenegen or torch trained it; train it again",
)


def needs(library: str, purpose: str) -> Diagnostic:
    """A library of the extra `experiments` that is not installed."""
    return NOT_INSTALLED(package=library, purpose=purpose, command='pip install "scenegen-dsl[experiments]"')
