"""A servo family: the YAML file beside this one. Its keys are those of data/servos/."""

from pathlib import Path

PROFILE = Path(__file__).with_name("demo.yaml")
