"""Several zones that exchange heat: their columns, and forecasts, loads and plans of all of them."""
