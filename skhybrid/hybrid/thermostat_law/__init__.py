"""The law of a thermostat and its plant, learned from a log, and forecasts in which it acts."""
