"""Where scenes go: files and physics of simulators, planning problems, robosuite, layouts. A leaf: the core does
without."""
