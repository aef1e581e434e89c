"""The suite that test_new.py makes: one task, its reversed task, two bands, three starts of each."""

import pytest


@pytest.fixture
def small(root):
    return root / "tests" / "golden" / "play" / "suites" / "small"
