"""Readers of logs, one format each, and what several of them share."""
