"""One training loop for every model: `loop.train`. `config` imports no torch."""
