"""Scenes in a simulator: settling, and loading a world into PyBullet. Only `drop` and `load` import pybullet."""
