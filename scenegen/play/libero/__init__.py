"""LIBERO and robosuite: the spec of a live environment, and states that its own judgement agrees with."""
