"""
A model per zone
================

A fleet keeps one model per zone.  This example fits twelve zones, one of which has a broken log, adds two days of
measurements, and shows which zones need attention.
"""

# %%
# One long table
# --------------
# A column names the zone of each row.
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skhybrid import ARXRegressor
from skhybrid.datasets import make_office
from skhybrid.fleet import ZoneFleet

offices = {
    f"floor {number}": make_office(n_days=17, sampling_time="1h", start="2024-01-08", random_state=number).X
    for number in range(1, 13)
}
X = pd.concat([rows.assign(zone=zone) for zone, rows in offices.items()])
X.loc[(X["zone"] == "floor 7") & (X.index.hour == 3), "T_oa"] = np.nan  # a logger that drops a row every night
training, later = X[X.index < "2024-01-22"], X[X.index >= "2024-01-22"]

# %%
# Fit
# ---
# ``errors_`` says why the zone with gaps cannot be fitted; the others are fitted.  ``ARXRegressor`` is fast; for a real
# fleet take :class:`~skhybrid.hybrid.HybridPredictor`.
fleet = ZoneFleet(ARXRegressor(), n_jobs=1).fit(training)
fleet.errors_

# %%
# Add two days, and forecast the next
# -----------------------------------
forecast = fleet.update(later[later.index < "2024-01-24"]).forecast(None, later[later.index >= "2024-01-24"])
forecast.head(3)

# %%
# The worst zones first
# ---------------------
# ``fleet.status(page="status.html")`` writes a page with a small chart per zone as well.
status = fleet.status()
status[["zone", "verdict", "rmse_yesterday", "rmse_training", "coverage"]].round(2)

# %%
figure, axes = plt.subplots(2, 2, figsize=(8, 5), sharex=True, layout="constrained")
for ax, zone in zip(axes.flat, status["zone"][1:], strict=False):
    ax.plot(offices[zone]["T_za"]["2024-01-24":], color="#222222", label="measured")
    ax.plot(forecast.loc[forecast["zone"] == zone, "T_za"], "--", color="#0072B2", label="forecast")
    ax.set_title(zone, loc="left", fontsize="medium")
    ax.tick_params(axis="x", rotation=30)
axes[0, 0].legend(frameon=False)
figure.supylabel("zone temperature [degC]")
figure.supxlabel("local time")
