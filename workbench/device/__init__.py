"""The way back to the robot: firmware tables and the limits that they keep."""

from workbench.device.firmware_tables import Export, export, read_tables, write_tables
from workbench.device.limits import Violation, check_limits

__all__ = ["Export", "Violation", "check_limits", "export", "read_tables", "write_tables"]
