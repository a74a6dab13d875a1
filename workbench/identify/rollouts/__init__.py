"""Rollouts of models on the takes of a session: one service with memory, resume and a count of work, for all kinds of takes."""
