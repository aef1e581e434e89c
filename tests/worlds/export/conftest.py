"""A PyBullet server."""

import pybullet
import pytest

from tests.worlds.export.bullet import Bullet


@pytest.fixture
def bullet():
    made = Bullet()
    yield made
    pybullet.disconnect(physicsClientId=made.client)
