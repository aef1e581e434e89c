"""A spec that passed the checker."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

from scenegen.lang.core import Core
from scenegen.scene.workspace import Workspace


@dataclass(frozen=True, slots=True)
class CheckedSpec:
    """What a spec means: the workspace, the objects in storage order, and the core formula with its labels.

    `source` is the canonical text that scene and model files carry; `name` is where it was read from; `title` is the
    sentence of its opening comment, if it has one.
    """

    name: str
    source: str
    workspace: Workspace
    core: Core
    title: str = ""

    @property
    def objects(self) -> tuple[str, ...]:
        return self.core.objects

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(self.core.labels)

    @property
    def sha256(self) -> str:
        """SHA-256 of the canonical text: two specs that differ in layout and comments alone share it."""
        return hashlib.sha256(self.source.encode()).hexdigest()
