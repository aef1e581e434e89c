"""What scenes become elsewhere: files of simulators, and physics. A leaf: the core does without it."""
