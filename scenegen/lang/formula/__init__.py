"""The core formula: its nodes, how they are made, and phi by floats and numpy."""
