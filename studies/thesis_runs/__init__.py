"""The thesis's five runs: playback of a recording, and ideal joint motion by two inputs under two filters (7.2.2)."""
