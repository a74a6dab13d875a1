"""Workbench for small legged robots on hobby servos: simulate, record, compare, and find the physics left out."""

from importlib.metadata import PackageNotFoundError, version

try:
    __version__ = version("drake-workbench")
except PackageNotFoundError:  # run from a source tree that was never installed
    __version__ = "0+unknown"
