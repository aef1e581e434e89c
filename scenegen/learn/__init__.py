"""What learns: phi in torch, models, training, cards. A leaf: the core does without it."""
