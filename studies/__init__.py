"""Studies: questions put to the workbench, each answered by a script."""
