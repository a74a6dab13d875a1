"""One file for each effect of docs/formats.md, section 7."""
