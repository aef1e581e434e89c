"""Strategies: which phi the next episode begins with. numpy only; any learner, any environment."""

from scenegen.learn.curriculum.strategies.registry import STRATEGIES, strategy

__all__ = ["STRATEGIES", "strategy"]
