"""PDDL and BDDL problems as specs, and scenes as PDDL facts."""
