"""Models on specs that nobody tuned them for: random specs, how they are measured, and the report."""
