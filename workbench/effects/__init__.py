"""Physics beyond the nominal model: one file for each effect of docs/formats.md, section 7."""
