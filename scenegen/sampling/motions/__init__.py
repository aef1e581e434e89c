"""Motions: traces of scenes over time, sampled exactly at a chosen phi (docs/motions.md)."""
