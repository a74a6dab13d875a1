"""To look at: figures, the 3D replay, the report page."""
