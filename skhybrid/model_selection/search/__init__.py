"""Search over the design matrix: candidates, workers, and the store of results."""
