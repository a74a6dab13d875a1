"""Fits of effect parameters by rollouts, their covariance and tests of the fitted model."""
