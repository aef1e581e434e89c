"""The facts of a diagnostic as data: which a kind has, and their values for JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from scenegen.errors.diagnostic import EXPANSION, Kind
from scenegen.errors.template import fields, missing


def names(kind: Kind) -> list[str]:
    """The facts that the texts of a kind can show, sorted; those of an expansion, which any kind can have, left out."""
    texts = [
        one
        for text in (kind.title, kind.label, kind.help, kind.note)
        for one in ([text] if isinstance(text, str) else text)
    ]
    return sorted(set[str]().union(*(part for text in texts for part in fields(text))) - fields(EXPANSION)[1])


def as_json(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Facts by name, with the missing ones left out. Texts, whole numbers, booleans and finite numbers are themselves,
    lists and mappings are walked, and anything else is its text: paths, infinity."""
    return {str(name): _plain(fact) for name, fact in facts.items() if not missing(fact)}


def _plain(fact: Any) -> Any:
    if isinstance(fact, bool | int | str):
        return fact
    if isinstance(fact, float):
        return float(fact) if math.isfinite(fact) else str(fact)
    if isinstance(fact, Mapping):
        return as_json(fact)
    if isinstance(fact, tuple | list | set | frozenset):
        return [None if one is None else _plain(one) for one in fact]
    return _plain(fact.item()) if hasattr(fact, "item") and getattr(fact, "ndim", 1) == 0 else str(fact)
