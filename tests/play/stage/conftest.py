"""A stage that the tests share: a suite of boxes, a cylinder, and two tasks."""

import pytest

from scenegen.play.stage.stage import TableStage
from scenegen.play.suites.suite import Suite


@pytest.fixture(scope="session")
def suite():
    return Suite.load("tabletop")


@pytest.fixture(scope="session")
def stage(suite):
    return TableStage.from_suite(suite)
