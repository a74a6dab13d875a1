"""Walking robots as Gymnasium environments, and a learned policy as a motion. The extra `[learn]` installs Gymnasium."""
