"""Scenes as OpenUSD stages, for Isaac Sim, Isaac Lab and other users of Omniverse (https://openusd.org)."""
