"""A CM-530 that runs the image that is flashed: unicorn for the processor, and the peripherals that the program uses.

Needs `unicorn` (PyPI), which only the tests and the virtual robot use. One cycle a halfword of instruction, no flash wait states;
interrupts do not nest, as the program sets no priorities (setting one is refused).
"""

from workbench.device.virtual.cm530.board import Board, Wire, check_image
from workbench.device.virtual.cm530.processor import BoardError

__all__ = ["Board", "BoardError", "Wire", "check_image"]
