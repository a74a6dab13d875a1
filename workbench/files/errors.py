"""The exception for input that a user has to correct."""

from __future__ import annotations

from os import PathLike

_LONGEST = 1000
"""Longest problem text [characters]; a library's message about a damaged file may fill pages."""


class InputError(ValueError):
    """Bad input, in one readable line: file, place in it, expected value. The command line prints it and exits with 2.

    source: the file, None where there is none. problem: the place in it, and the expected value.
    """

    def __init__(self, source: str | PathLike[str] | None, problem: str) -> None:
        self.source = None if source is None else "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(source))
        self.problem = " ".join("".join(c if c.isprintable() or c.isspace() else repr(c)[1:-1] for c in str(problem)).split())
        if len(self.problem) > _LONGEST:
            self.problem = f"{self.problem[:_LONGEST]}..."
        super().__init__(f"{self.source}: {self.problem}" if self.source else self.problem)

    def __reduce__(self) -> tuple[type[InputError], tuple[str | None, str]]:
        return type(self), (self.source, self.problem)  # so that it can be pickled to another process


class UnknownFolderError(InputError):
    """A folder that holds no recording of a known format."""


class MistypedError(InputError):
    """A mistake made by a person (an unknown joint, a word where a number belongs): such a file is refused, not left out as
    damaged."""


def in_words(error: Exception) -> str:
    """Why content has another form than expected, in words for whoever wrote the file, of the error that taking it apart gave."""
    if isinstance(error, KeyError):
        return f"'{error.args[0]}' is missing" if error.args else "a key is missing"
    if isinstance(error, (TypeError, AttributeError, IndexError)):
        return "a value is of another kind than expected"
    return " ".join(str(error).split())[:200]
