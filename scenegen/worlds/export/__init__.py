"""Scenes as worlds for simulators: MJCF, SDF, OBJ and STL."""
