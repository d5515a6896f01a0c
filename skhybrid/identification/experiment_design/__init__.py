"""Experiment design: the information that a planned experiment would give."""
