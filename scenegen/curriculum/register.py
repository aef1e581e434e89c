"""What gymnasium calls when it looks for environments (the entry point in pyproject.toml)."""

from __future__ import annotations


def register_environments() -> None:
    """Make `scenegen/TableTop-v0` known to gymnasium."""
    import gymnasium

    # gymnasium puts the entry point's name, `scenegen`, before the id
    gymnasium.register(id="TableTop-v0", entry_point="scenegen.curriculum.env:TableTop")
