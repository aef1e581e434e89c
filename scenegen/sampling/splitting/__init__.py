"""Multilevel splitting: levels, chains and their moves."""
