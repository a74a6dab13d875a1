"""The thesis's input filters: what each window does to a motion, and to the walk that comes of it."""
