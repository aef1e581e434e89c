"""Headless pictures of scenes."""
