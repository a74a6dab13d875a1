"""Session in, findings out: what the model lacks that the recording shows."""
