"""Learning with the scenes: environments, strategies that choose the next task, tabular learners."""
