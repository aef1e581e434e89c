"""Suites in the harnesses that people run: a module each."""
