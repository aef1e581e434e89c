"""Scenes as arrays; their files, sets and stores."""
