"""Pictures and figures of scenes and motions. A leaf: the core does without it."""
