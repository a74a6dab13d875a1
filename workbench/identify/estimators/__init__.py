"""Direct estimates from the recordings, without a search: lengths, zeros, stops, loose mounts, dropped commands."""
