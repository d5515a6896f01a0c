"""Diagnostics of a fit: tests of its residuals, and responses to its inputs."""
