"""The paper's experiments and ours, beside the product: `python -m experiments NAME|all --out DIR` (or `make
experiments`) from the root of the repository. Not part of the wheel; needs the extra `experiments`.

`table` lists them and imports nothing heavy.
"""
