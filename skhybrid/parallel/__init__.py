"""Work on joblib's processes, Dask or Ray, and the settings by which what was stored is known again."""
