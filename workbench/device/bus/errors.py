"""Errors on a bus, in one line that names servo, joint and register."""

from __future__ import annotations

from workbench.files import InputError


class BusError(InputError):
    """A failure on the bus. servo (bus ID), joint, register: where it happened, None where no single one is concerned; cause: the
    problem without that place."""

    def __init__(self, problem: str, servo: int | None = None, joint: str | None = None, register: str | None = None) -> None:
        self.servo, self.joint, self.register, self.cause = servo, joint, register, problem
        name = None if servo is None else f"servo {servo}" + (f" ({joint})" if joint else "")
        place = ", ".join(part for part in (name, register and f"register {register}") if part)
        super().__init__(None, f"{place}: {problem}" if place else problem)

    def __reduce__(self) -> tuple[type[BusError], tuple[object, ...]]:  # type: ignore[override]
        return type(self), (self.cause, self.servo, self.joint, self.register)


class NoAnswerError(BusError):
    """A servo that was silent, or could not be understood, as often as it was asked."""


class PortGoneError(BusError):
    """The adapter was pulled, or the operating system took it away."""
