"""Which of a spec's labels something is about."""

from __future__ import annotations

from collections.abc import Sequence

from scenegen.errors import Diagnostic, RequestError, quoted, suggest


def chosen_label(labels: Sequence[str], label: str | None) -> str:
    """The label asked for, or the first. Raises RequestError for one that the spec does not have."""
    if label is None:
        return labels[0]
    if label not in labels:
        help_ = suggest(label, labels, f"the labels are {quoted(labels)}")
        raise RequestError(Diagnostic(f"the spec has no label `{label}`", help=help_))
    return label
