"""What servo logs get wrong: units, leaps, readings that stand, zeros that shift, goals that are none."""
