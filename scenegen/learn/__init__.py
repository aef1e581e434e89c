"""What learns: phi in torch, models, training, cards, environments, curricula. A leaf: the core does without it."""
