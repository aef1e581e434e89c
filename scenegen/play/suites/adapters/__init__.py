"""Worlds in which the starts of a suite are run."""
