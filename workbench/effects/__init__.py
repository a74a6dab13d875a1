"""Physics beyond the nominal model: one file for each effect of the contract, section 7."""
