"""Scenes in a simulator: settling, and loading a world into PyBullet. Only `bullet` imports pybullet."""
