"""The 3D replay."""
