"""Grammars for language models: what can be said about the objects of a spec, as a context-free grammar.

`forms.py` lists what a formula can name and what can be said of it, from the table of relations;
`trial.py` keeps what checks and what some scene satisfies; `grammar.py` makes rules of it, and `rules.py`
writes them.
"""
