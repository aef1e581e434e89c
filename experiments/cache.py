"""The cache of runs: what earlier runs found, one file each, so that no run is repeated.

A run's request holds all that its result follows from. Its file is named after the run and a digest of the request, and
holds both the request and what was found: a changed setting is another file, and a damaged file counts as missing.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from pydantic import BaseModel, ValidationError

from scenegen.scenes.files import ensure_folder, write_whole

FOLDER = "runs"  # of the reports' folder
DIGITS = 16  # of a digest in a file's name

Request = Mapping[str, Any]
"""What JSON can hold."""
R = TypeVar("R", bound=BaseModel)


@dataclass(frozen=True, slots=True)
class Cache:
    """The runs kept in a folder."""

    folder: Path

    @classmethod
    def beside(cls, out: Path) -> Cache:
        """The cache of the reports in a folder, made if its parent is there. Git ignores it. Raises OutputError."""
        folder = out / FOLDER
        ensure_folder(folder)
        write_whole(folder / ".gitignore", b"*\n")
        return cls(folder)

    def path(self, name: str, request: Request, ending: str = ".json") -> Path:
        """The file of a run; with another ending, one that belongs to it."""
        digest = hashlib.sha256(canonical(request).encode()).hexdigest()
        return self.folder / f"{name}-{digest[:DIGITS]}{ending}"

    def find(self, name: str, request: Request, kind: type[R]) -> R | None:
        """What a run found, if it is there and whole."""
        try:
            document = json.loads(self.path(name, request).read_bytes())
            if not isinstance(document, dict) or canonical(document.get("request")) != canonical(request):
                return None
            return kind.model_validate(document.get("found"))
        except (OSError, ValueError, ValidationError):
            return None

    def keep(self, name: str, request: Request, found: BaseModel) -> None:
        """Write what a run found. Raises OutputError."""
        document = {"request": request, "found": found.model_dump(mode="json")}
        write_whole(self.path(name, request), (json.dumps(document, indent=1) + "\n").encode())


def canonical(request: object) -> str:
    """A request as text: equal texts are equal requests."""
    return json.dumps(request, sort_keys=True, separators=(",", ":"))
