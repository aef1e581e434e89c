"""The recipes and examples of docs/layouts.md."""

import re
from pathlib import Path

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "layouts.md").read_text()


def recipe(name, other=None):
    """The function with which a recipe begins, or another one of it."""
    (text,) = re.findall(rf"^```python\n(def {name}\(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    found = {}
    exec(text, found)  # noqa: S102 - our own page
    return found[other or name]


def example(needs):
    """What the example that needs this package leaves behind, by name."""
    (text,) = re.findall(rf"^```python needs={needs}\n(.*?)^```$", PAGE, re.MULTILINE | re.DOTALL)
    found = {}
    exec(text, found)  # noqa: S102 - our own page
    return found
