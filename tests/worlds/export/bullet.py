"""PyBullet for tests."""

import pybullet


class Bullet:
    """A PyBullet of its own."""

    def __init__(self):
        self.client = pybullet.connect(pybullet.DIRECT)

    def frame(self, number):
        """Where a body's own frame is, not its centre of mass, and how far it is turned about z."""
        place, turn = pybullet.getBasePositionAndOrientation(number, physicsClientId=self.client)
        info = pybullet.getDynamicsInfo(number, -1, physicsClientId=self.client)
        where, turned = pybullet.multiplyTransforms(place, turn, *pybullet.invertTransform(info[3], info[4]))
        return where, pybullet.getEulerFromQuaternion(turned)[2]
