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
fig, ax = plt.subplots(figsize=(8, 4), layout="constrained")
actual = y[n_train:]
ax.fill_between(
    tomorrow.index, tomorrow["q_0.1"], tomorrow["q_0.9"], color="tab:blue", alpha=0.2, label="80 % interval"
)
ax.plot(actual.index, actual, color="black", label="measured")
ax.plot(tomorrow.index, tomorrow["T_za"], color="tab:blue", label="hybrid")
ax.plot(actual.index, plain, color="tab:orange", label="gray box without a disturbance")
ax.set_ylabel("zone temperature [degC]")
ax.legend()
fig.autofmt_xdate()

# %%
# What the hybrid has learned
# ---------------------------
# Schedules of unmeasured heat and of conductance, beside what its network has, for working days and weekends.  Stages
# are all that is logged of the plant here, so that these kW are relative.
ScheduleDisplay.from_estimator(hybrid)

# %%
# The building
# ------------
# The hybrid's network is fitted to forecast well, and its parameters are not the building's.  For those there is the
# identification; here are its parameters beside the true and the conventional ones.
identified = PeriodicDisturbanceID(known=name_plate, random_state=0).fit(X[:n_train], y[:n_train])
pd.DataFrame({"true": office.theta, "identified": identified.theta_, "conventional": conventional.theta_}).round(2)

# %%
# Its disturbance is the heat of people, plugs, lights and air, here over the last week of the training.
week = slice(n_train - 7 * PER_DAY, n_train)
zeta = identified.estimate_disturbance(X[:n_train], smooth=True)
fig, ax = plt.subplots(figsize=(8, 3.5), layout="constrained")
ax.plot(X.index[week], office.heat_gain[week], color="black", label="true heat gain")
ax.plot(X.index[week], zeta[week], color="tab:blue", label="estimated")
ax.set_ylabel("unmeasured heat [kW]")
ax.legend()
fig.autofmt_xdate()
