"""Which of a spec's labels something is about."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.errors import RequestError
from scenegen.errors.requests import UNKNOWN_LABEL


def chosen_label(labels: Sequence[str], label: str | None) -> str:
    """The label asked for, or the first. Raises RequestError for one that the spec does not have."""
    if label is None:
        return labels[0]
    if label not in labels:
        raise RequestError(UNKNOWN_LABEL(name=label, known=labels))
    return label
