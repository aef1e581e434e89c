"""Work shared among processes: the plan of a run, its pieces and their random numbers."""
