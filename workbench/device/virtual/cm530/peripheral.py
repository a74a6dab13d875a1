"""What every peripheral is: words at offsets, dead while its clock is off."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from workbench.device.virtual.cm530.board import Board


class Peripheral:
    """Words that can be read and written; sub-classes give some of them a meaning. gate: RCC register offset and bit of its
    clock, None where it is always on. clocked: whether that clock runs."""

    known: frozenset[int] = frozenset()

    def __init__(self, board: Board, gate: tuple[int, int] | None) -> None:
        self.board, self.gate = board, gate
        self.clocked = gate is None
        self.words = dict.fromkeys(self.known, 0)

    def reset(self) -> None:
        """The state after a reset of the chip."""
        self.words = dict.fromkeys(self.known, 0)

    def read(self, offset: int) -> int:
        """A word."""
        return self.words[offset]

    def write(self, offset: int, value: int) -> None:
        """A word."""
        self.words[offset] = value

    def interrupts(self) -> bool:
        """Whether its interrupt line is up."""
        return False
