"""
Forecast tomorrow's room temperature
====================================

A synthetic office, of which the truth is known: identify a thermal network in spite of the unmeasured heat, learn that
heat, and forecast the last day of the log from the midnight before it.
"""

# %%
# The log
# -------
# A row is a step of 15 minutes.  ``X`` holds the weather, the runtime fractions of heating and cooling and, as
# history, the measured room temperature; ``y`` is the room temperature.  ``heat_gain`` is the truth that no one
# measures: people, plugs, lights and air.
import matplotlib.pyplot as plt
import pandas as pd

from skhybrid import GrayBoxRC, HybridPredictor, PeriodicDisturbanceID
from skhybrid.datasets import make_office

PER_DAY = 96

office = make_office(n_days=18, random_state=0)
X, y = office.X, office.y
X.describe().loc[["min", "mean", "max"]].round(2)

# %%
# Two models
# ----------
# The hybrid predictor, and the conventional gray box, which takes the unmeasured heat for noise.  The capacity on the
# name plate fixes the scale of the network, which temperatures alone cannot.
n_train = len(X) - PER_DAY
name_plate = {"Q_h": 6.0}  # kW
hybrid = HybridPredictor(PeriodicDisturbanceID(known=name_plate), random_state=0).fit(X[:n_train], y[:n_train])
conventional = GrayBoxRC(known=name_plate, n_starts=5, random_state=0).fit(X[:n_train], y[:n_train])

# %%
# The identified parameters beside the true ones.
pd.DataFrame({"true": office.theta, "hybrid": hybrid.gray_box_.theta_, "conventional": conventional.theta_}).round(2)

# %%
# Tomorrow
# --------
# From the last row of the history, with the weather and the control of tomorrow known.
origin = n_train - 1
history, future = X[:n_train], X[n_train:].drop(columns="T_za")
tomorrow = hybrid.forecast(history, future)
plain = conventional.predict_from(X, [origin], horizon="1D")[0]

# %%
# Beside what came.
fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 6), layout="constrained")
actual = y[n_train:]
above.plot(actual.index, actual, color="black", label="measured")
above.plot(tomorrow.index, tomorrow["T_za"], color="tab:blue", label="hybrid")
above.plot(actual.index, plain, color="tab:orange", label="gray box without a disturbance")
above.set_ylabel("zone temperature [degC]")
above.legend()
below.plot(actual.index, office.heat_gain[n_train:], color="black", label="true heat gain")
below.plot(tomorrow.index, tomorrow["zeta"], color="tab:blue", drawstyle="steps-post", label="forecast disturbance")
below.set_ylabel("unmeasured heat [kW]")
below.legend()
fig.autofmt_xdate()
