"""The demo: comparison, diagnosis and gait search on bundled data, on one page."""

from workbench.api.demo.page import run_demo

__all__ = ["run_demo"]
