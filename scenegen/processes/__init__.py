"""Other processes: a pool of them, what they run, interrupts and threads."""
