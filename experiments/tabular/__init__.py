"""Tabular learners for tasks on a grid, compiled by numba (extra `experiments`)."""
