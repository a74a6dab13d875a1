"""What `import workbench` offers: functions that take sessions and return typed results, which can be saved or shown in a
notebook."""
