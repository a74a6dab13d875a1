"""What `import workbench` offers: sessions in, typed results out, which save themselves and show themselves in a notebook."""
