"""What a diagnosis says, as types: findings, reasons, ties, and what each take was."""
