"""Measures the speeds stated in the documentation, all in one run. Figures that compare with MuJoCo are skipped where
studies/ is not available."""
