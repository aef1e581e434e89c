"""What to practise next: one file per strategy."""
