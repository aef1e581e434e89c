"""Does phi predict success? Recorded outcomes of three policies on three tasks, and tables of them."""
