"""The ground floor: files read and written whole, errors a user can correct, plug-ins, and where models and data lie."""

from workbench.files.errors import InputError

__all__ = ["InputError"]
