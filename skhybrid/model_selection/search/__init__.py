"""The search over the design matrix: candidates, workers, and the store of their results."""
