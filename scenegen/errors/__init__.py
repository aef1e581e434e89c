"""Diagnostics: what scenegen reports when something is wrong.

Every problem a user can cause is a `Diagnostic`: a `Kind` with a stable code, a place in a text, and facts. The kinds
are listed in the modules of this folder, one for each stage. `diagnostic.py` turns facts into
prose and data, and prose into text. Problems travel in `ScenegenError`. `catalog.py` has all kinds, and what `scenegen
explain` says.
"""

from __future__ import annotations

from scenegen.errors.diagnostic import (
    DataError,
    Diagnostic,
    Kind,
    OutputError,
    RequestError,
    ScenegenError,
    Severity,
    Source,
    Span,
    SpecError,
    nearest,
    quote_names,
    render,
    render_all,
    to_json,
)

__all__ = [
    "DataError",
    "Diagnostic",
    "Kind",
    "OutputError",
    "RequestError",
    "ScenegenError",
    "Severity",
    "Source",
    "Span",
    "SpecError",
    "nearest",
    "quote_names",
    "render",
    "render_all",
    "to_json",
]
