"""Output for people: figures, 3D replays and report pages."""
