import pytest

from scenegen.learn.models import registry
from scenegen.learn.training import config


@pytest.fixture(autouse=True, scope="module")
def tables():
    """What experiments add to the product's tables is there for their own tests alone."""
    both = (registry.MODELS, config.DEFAULTS, config.DATASETS)
    before = [dict(table) for table in both]
    yield
    for table, entries in zip(both, before, strict=True):
        table.clear()
        table.update(entries)
