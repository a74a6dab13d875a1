"""The trial of diagnosis: robots of another engine whose hidden physics nobody chose."""
