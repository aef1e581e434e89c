"""Grammars of what can be said about the objects of a spec, as context-free grammars.

`statements.py` lists what a formula can name and what can be said of it, and keeps what checks and what some scene
satisfies; `grammar.py` makes rules of it, and `rules.py` writes them.
"""
