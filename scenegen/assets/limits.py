"""What files of one's own may say of an object's body."""

from __future__ import annotations

LEAST_MASS, MOST_MASS = 1e-6, 1e6  # kg
MOST_FRICTION = 100.0  # coefficient of sliding friction
