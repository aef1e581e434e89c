"""Pruned rejection: a cover of the scenes in the range, and draws from it."""
