"""Which effects enter the model: forward selection with swaps and pairs, and the comparison of rival models."""
