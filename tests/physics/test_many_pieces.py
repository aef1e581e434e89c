"""PyBullet takes 16 pieces of a body at once; bodies with more have all of theirs."""

import numpy as np
import pytest

from scenegen.things.mesh import box, disc
from scenegen.worlds.physics.bodies import MOST_PIECES, InertialBody, piece_files
from scenegen.worlds.physics.bullet import PybulletWorld

SIDE = 0.05


def body(pieces, mass):
    moment = mass * SIDE**2 / 6.0
    return InertialBody(tuple(pieces), (0.0, 0.0, 0.0), 0.0, mass, (moment,) * 3, 0.7)


@pytest.mark.parametrize("piece", [box(SIDE, SIDE, SIDE), disc(SIDE / 2, 0.0, SIDE, 8)], ids=["box", "hull"])
@pytest.mark.parametrize("count", [MOST_PIECES, MOST_PIECES + 1, 40])
def test_the_last_piece_of_a_body_carries(piece, count):
    row = [piece.moved(x=0.2 * k, z=0.1 - SIDE) for k in range(count)]
    block = box(SIDE, SIDE, SIDE).moved(z=-SIDE / 2)
    bodies = [body(row, 0.0), body([block], 0.1)]
    with piece_files(bodies) as files, PybulletWorld(bodies, files, friction=0.7) as world:
        places = np.array([(0.0, 0.0, 0.0, 0.0), (0.2 * (count - 1), 0.0, 0.0, 0.1 + SIDE / 2)])
        found, _ = world.rest(places, 0.2)
    assert found[1, 2] == pytest.approx(0.1 + SIDE / 2, abs=1e-3)
