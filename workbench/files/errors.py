"""The one exception for input that a user has to correct."""

from __future__ import annotations

from os import PathLike

_LONGEST = 1000
"""Letters of a problem; what a library says of a damaged file may go on for pages."""


class InputError(ValueError):
    """Bad input, in one readable line: which file, where in it, what was expected. The command line prints it and exits with 2.

    source: the file, None where there is none. problem: the place in it, and what was expected.
    """

    def __init__(self, source: str | PathLike[str] | None, problem: str) -> None:
        self.source = None if source is None else "".join(c if c.isprintable() else repr(c)[1:-1] for c in str(source))
        self.problem = " ".join("".join(c if c.isprintable() or c.isspace() else repr(c)[1:-1] for c in str(problem)).split())
        if len(self.problem) > _LONGEST:
            self.problem = f"{self.problem[:_LONGEST]}..."
        super().__init__(f"{self.source}: {self.problem}" if self.source else self.problem)

    def __reduce__(self) -> tuple[type[InputError], tuple[str | None, str]]:
        return type(self), (self.source, self.problem)  # so that it comes back whole from another process


class MistypedError(InputError):
    """What a person wrote wrongly (an unknown joint, a word where a number belongs): a file with it is refused, not left out as
    damaged."""
