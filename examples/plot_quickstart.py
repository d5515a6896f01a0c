"""
Forecast tomorrow's room temperature
====================================

A synthetic office, of which the truth is known: forecast the last day of the log from the midnight before it, with an
interval, and identify the building's thermal network in spite of the heat that no one measures.
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
from skhybrid.inspection import ScheduleDisplay

PER_DAY = 96

office = make_office(n_days=18, random_state=0)
X, y = office.X, office.y
X.describe().loc[["min", "mean", "max"]].round(2)

# %%
# Two forecasters
# ---------------
# The hybrid predictor, and the conventional gray box, which takes the unmeasured heat for noise.  The capacity on the
# name plate fixes the scale of the network, which temperatures alone cannot.
n_train = len(X) - PER_DAY
name_plate = {"Q_h": 6.0}  # kW
hybrid = HybridPredictor(random_state=0).fit(X[:n_train], y[:n_train])
conventional = GrayBoxRC(known=name_plate, n_starts=5, random_state=0).fit(X[:n_train], y[:n_train])

# %%
# Tomorrow
# --------
# From the last row of the history, with the weather and the control of tomorrow known.
origin = n_train - 1
history, future = X[:n_train], X[n_train:].drop(columns="T_za")
tomorrow = hybrid.forecast(history, future, quantiles=(0.1, 0.9))
plain = conventional.predict_from(X, [origin], horizon="1D")[0]

# %%
# Beside what came.
fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(8, 6), layout="constrained")
actual = y[n_train:]
above.plot(actual.index, actual, color="black", label="measured")
above.plot(tomorrow.index, tomorrow["T_za"], color="tab:blue", label="hybrid")
above.fill_between(tomorrow.index, tomorrow["q_0.1"], tomorrow["q_0.9"], color="tab:blue", alpha=0.2, label="80 %")
above.plot(actual.index, plain, color="tab:orange", label="gray box without a disturbance")
above.set_ylabel("zone temperature [degC]")
above.legend()
below.plot(actual.index, office.heat_gain[n_train:], color="black", label="true heat gain")
below.plot(tomorrow.index, tomorrow["zeta"], color="tab:blue", drawstyle="steps-post", label="forecast disturbance")
below.set_ylabel("unmeasured heat [kW]")
below.legend()
fig.autofmt_xdate()

# %%
# What the hybrid has learned
# ---------------------------
# Schedules of unmeasured heat and of conductance, beside what its network has, for working days and weekends.
ScheduleDisplay.from_estimator(hybrid)

# %%
# The building
# ------------
# The hybrid's network is fitted to forecast well, and its parameters are not the building's.  For those there is the
# identification; here are its parameters beside the true and the conventional ones.
identified = PeriodicDisturbanceID(known=name_plate, random_state=0).fit(X[:n_train], y[:n_train])
pd.DataFrame({"true": office.theta, "identified": identified.theta_, "conventional": conventional.theta_}).round(2)
