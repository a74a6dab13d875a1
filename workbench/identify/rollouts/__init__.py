"""Rollouts of models on the takes of a session: one service with memory, resume and a count of work, for all kinds of takes."""

from workbench.identify.rollouts.evaluator import RolloutEvaluator, RolloutRequest, take_of

__all__ = ["RolloutEvaluator", "RolloutRequest", "take_of"]
