"""Real and emulated hardware: firmware tables, the controller, the servo bus, the player, and motion capture."""

from workbench.device.tables.firmware_tables import Export, export, read_tables, write_tables
from workbench.device.tables.limits import Violation, check_limits
from workbench.device.tables.table_file import JointBounds, TableFile, decode_table, encode_table, read_table_file

__all__ = [
    "Export", "JointBounds", "TableFile", "Violation", "check_limits", "decode_table", "encode_table", "export",
    "read_table_file", "read_tables", "write_tables",
]
