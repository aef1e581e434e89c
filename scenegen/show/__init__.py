"""What shows: pictures, figures, looks, and the page of `scenegen view`. A leaf: the core does without it."""
