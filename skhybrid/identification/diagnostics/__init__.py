"""Diagnostics of a fit: tests of its residuals, and a report of them."""
