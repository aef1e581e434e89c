"""Drawing scenes for a range of phi: requests, plans, the exact samplers, and the engine that runs them."""
