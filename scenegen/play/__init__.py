"""What is done with scenes: environments, strategies, starts for simulators, suites. An app: nothing imports it."""
