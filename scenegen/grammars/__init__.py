"""Grammars for language models: what can be said about the objects of a spec, as a context-free grammar.

`vocabulary.py` lists what a formula can name, `forms.py` what can be said of it, from the table of relations;
`trial.py` keeps what checks and what some scene satisfies; `goals.py` makes rules of it, and `lark.py` and `gbnf.py`
write them.
"""
