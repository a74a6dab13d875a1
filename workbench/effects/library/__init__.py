"""One file for each effect of the contract, section 7."""
