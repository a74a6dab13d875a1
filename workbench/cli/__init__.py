"""One file for each verb, no logic."""
