"""Suites: frozen, graded starts of several tasks; policies that run on them; what their outcomes say."""
