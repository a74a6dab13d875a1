"""Pages that hold a whole result."""
