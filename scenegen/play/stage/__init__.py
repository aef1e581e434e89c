"""Suites on a real table: a printed mat and sheets, what stands there by a photograph, and how hard that is."""
