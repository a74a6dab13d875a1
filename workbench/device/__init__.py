"""The way back to the robot: firmware tables and the limits that they keep."""

from workbench.device.firmware_tables import Export, export, read_tables, write_tables
from workbench.device.limits import Violation, check_limits
from workbench.device.table_file import JointBounds, TableFile, decode_table, encode_table, read_table_file

__all__ = [
    "Export", "JointBounds", "TableFile", "Violation", "check_limits", "decode_table", "encode_table", "export",
    "read_table_file", "read_tables", "write_tables",
]
