"""Workers on joblib, Dask or Ray, and the settings by which a store is compared with a new run."""
