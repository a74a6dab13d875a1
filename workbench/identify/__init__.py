"""Which physics the model lacks: from residuals of a session to named effects with sizes and probabilities."""
