"""Which physics do the published friction models of a Dynamixel XL-330 lack? Run by `python -m studies.xl330`."""
