"""Scenes of specs with priors, held against plain rejection and against Scenic."""
