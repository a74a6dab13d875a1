"""Results of a diagnosis, as types: findings, reasons, ties, and a report on each take."""
