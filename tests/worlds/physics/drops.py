"""Scenes that are dropped once."""

from scenegen.worlds.physics.settling import Settler


def settle_scenes(shapes, poses, *, fixed=(), workers=None):
    """The motions of scenes (scenes, objects, 3) of objects of these shapes; see `Settler`."""
    with Settler(shapes, fixed=fixed, workers=workers) as settler:
        return settler.settle(poses)
