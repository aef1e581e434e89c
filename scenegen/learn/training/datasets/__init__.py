"""Data sets: scenes labelled with phi, for training. `table` lists them and imports no torch."""
