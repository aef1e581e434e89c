"""The parts of the experiment `curriculum`: what is run, how it is run and kept, its tables."""
