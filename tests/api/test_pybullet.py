"""`load_pybullet`: a scene in a running PyBullet is the scene, and it stays as it is."""

import numpy as np
import pybullet
import pytest
from pybullet_utils.bullet_client import BulletClient

import scenegen
from scenegen.things import asset_of
from tests.export.bullet import Bullet
from tests.export.worlds import library, tower


@pytest.fixture
def bullet():
    made = Bullet()
    yield made
    pybullet.disconnect(physicsClientId=made.client)


def shifts(bullet, bodies, seconds=1.0):
    before = {name: bullet.frame(number)[0] for name, number in bodies.items()}
    pybullet.setGravity(0, 0, -9.81, physicsClientId=bullet.client)
    for _ in range(round(240 * seconds)):
        pybullet.stepSimulation(physicsClientId=bullet.client)
    return {name: np.linalg.norm(np.subtract(bullet.frame(bodies[name])[0], at)) for name, at in before.items()}


@pytest.mark.long
@pytest.mark.parametrize("number, mug", [(0, 0.007), (1, 0.0)])
def test_objects_are_where_the_scene_says(number, mug, bullet):
    scenes = tower()
    bodies = scenegen.load_pybullet(scenes[number], bullet.client)
    assert tuple(bodies) == scenes.objects
    for name, pose in scenes[number].poses.items():
        where, turned = bullet.frame(bodies[name])
        np.testing.assert_allclose([*where[:2], turned % (2 * np.pi)], [pose.x, pose.y, pose.theta], atol=1e-6)
    assert bullet.frame(bodies["mug"])[0][2] == pytest.approx(mug, abs=1e-6)


def test_mass_friction_and_what_is_held(bullet):
    bodies = scenegen.load_pybullet(tower()[0], bullet.client)
    info = {name: pybullet.getDynamicsInfo(one, -1, physicsClientId=bullet.client) for name, one in bodies.items()}
    assert info["mug"][0] == pytest.approx(asset_of("mug").mass) and info["tray"][0] == 0.0
    assert info["mug"][1] == pytest.approx(asset_of("mug").friction)
    np.testing.assert_allclose(info["block[1]"][2], asset_of("block").mass * 0.05**2 / 6)


def test_nothing_moves(bullet):
    assert max(shifts(bullet, scenegen.load_pybullet(tower()[0], bullet.client)).values()) < 2e-3


@pytest.mark.long
def test_the_whole_library_stands_still(bullet):
    moved = shifts(bullet, scenegen.load_pybullet(library()[0], bullet.client), 0.5)
    assert max(moved.values()) < 1e-3, moved


def test_without_the_table(bullet):
    floor = pybullet.createCollisionShape(pybullet.GEOM_PLANE, physicsClientId=bullet.client)
    pybullet.createMultiBody(0.0, floor, physicsClientId=bullet.client)
    bodies = scenegen.load_pybullet(tower()[1], bullet.client, table=False)
    assert pybullet.getNumBodies(physicsClientId=bullet.client) == 1 + len(bodies)
    assert max(shifts(bullet, bodies).values()) < 2e-3


def test_clients_of_either_kind():
    client = BulletClient(pybullet.DIRECT)
    assert len(scenegen.load_pybullet(tower()[1], client)) == 5 == client.getNumBodies() - 1
    number = client._client
    del client
    with pytest.raises(scenegen.RequestError, match=f"PyBullet client {number} is not connected"):
        scenegen.load_pybullet(tower()[1], number)
