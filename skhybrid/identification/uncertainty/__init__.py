"""Uncertainty of a fit: standard errors, identifiability, profile likelihood, posterior."""
