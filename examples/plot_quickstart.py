"""
Forecast tomorrow's room temperature
====================================

The office is synthetic, so the truth is known.  This example forecasts the last day of the log from the midnight before
it, with an interval, and identifies the building's thermal network in spite of the heat that nobody measures.
"""

# %%
# The log
# -------
# A row is a step of 15 minutes.  ``X`` holds the weather (``T_oa`` [degC], ``q_sol`` [kW/m2]), the runtime fractions of
# heating and cooling [-] and, as history, the measured room temperature ``T_za`` [degC]; ``y`` is the room temperature.
# ``heat_gain`` is the true heat that nobody measures [kW]: people, plug loads, lights and air.
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
# The hybrid predictor, and a gray box alone, which treats the unmeasured heat as noise.  The capacity on the
# nameplate fixes the scale of the network, which temperatures alone cannot.
n_train = len(X) - PER_DAY
nameplate = {"Q_h": 6.0}  # kW
hybrid = HybridPredictor(known=nameplate).fit(X[:n_train], y[:n_train])
gray_box = GrayBoxRC(known=nameplate, n_starts=5, random_state=0).fit(X[:n_train], y[:n_train])

# %%
# Tomorrow
# --------
# The forecast starts from the last row of the history, with tomorrow's weather and control known.
origin = n_train - 1
history, future = X[:n_train], X[n_train:].drop(columns="T_za")
tomorrow = hybrid.forecast(history, future, quantiles=(0.1, 0.9))
plain = gray_box.predict_from(X, [origin], horizon="1D")[0]

# %%
# The forecast and the measurement.
fig, ax = plt.subplots(figsize=(8, 4), layout="constrained")
fig.suptitle("Room temperature of tomorrow, forecast and measured")
actual = y[n_train:]
ax.fill_between(
    tomorrow.index, tomorrow["q_0.1"], tomorrow["q_0.9"], color="tab:blue", alpha=0.2, label="80 % interval"
)
ax.plot(actual.index, actual, color="black", label="measured")
ax.plot(tomorrow.index, tomorrow["T_za"], color="tab:blue", label="hybrid")
ax.plot(actual.index, plain, color="tab:orange", label="gray box without a disturbance")
ax.set_ylabel("zone temperature [degC]")
ax.legend()
ax.set_xlabel("local time")
fig.autofmt_xdate()

# %%
# The learned schedules
# ---------------------
# The hybrid learns schedules of unmeasured heat and of additional conductance, for working days and weekends.
ScheduleDisplay.from_estimator(hybrid).figure_.suptitle("Learned schedules of the forecast network")

# %%
# The building
# ------------
# The hybrid's network is fitted to forecast well, and its parameters are not those of the building.  An identification
# finds those.  Its parameters, the true ones and those of the gray box:
identified = PeriodicDisturbanceID(known=nameplate, random_state=0).fit(X[:n_train], y[:n_train])
pd.DataFrame({"true": office.theta, "identified": identified.theta_, "gray box": gray_box.theta_}).round(2)

# %%
# The identified disturbance is the heat of people, plug loads, lights and air, here over the last week of the training.
week = slice(n_train - 7 * PER_DAY, n_train)
zeta = identified.estimate_disturbance(X[:n_train], smooth=True)
fig, ax = plt.subplots(figsize=(8, 3.5), layout="constrained")
fig.suptitle("Unmeasured heat, estimated and true")
ax.plot(X.index[week], office.heat_gain[week], color="black", label="true heat gain")
ax.plot(X.index[week], zeta[week], color="tab:blue", label="estimated")
ax.set_ylabel("unmeasured heat [kW]")
ax.legend()
ax.set_xlabel("local time")
fig.autofmt_xdate()
