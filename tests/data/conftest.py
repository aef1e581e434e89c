import runpy
from pathlib import Path

import pytest

exp1_spec = runpy.run_path(str(Path(__file__).parents[1] / "models" / "exp1.py"))["exp1_spec"]


@pytest.fixture
def exp1():
    return exp1_spec()


@pytest.fixture
def make_exp1():
    return exp1_spec
