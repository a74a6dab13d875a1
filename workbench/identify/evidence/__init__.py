"""Which physics is missing, by one likelihood: evidence of models whose discrepancy is estimated, one search, a posterior over
names."""
