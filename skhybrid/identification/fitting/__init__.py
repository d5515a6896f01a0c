"""Fitting: residuals and their derivatives, Gauss-Newton, starts, priors."""
