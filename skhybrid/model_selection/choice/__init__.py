"""Choice of a disturbance model: Bayesian tests and the paper's rules."""
