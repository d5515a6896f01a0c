"""
The heat that tomorrow will need
================================

A small office, simulated with EnergyPlus.  Tomorrow's set-points and weather are known; what people will do is not.
How much heat will the office need, when is the peak, and what would a smaller plant do?
"""

# %%
# The log
# -------
# ``Q_hvac`` is the heat that the plant delivered [kW], negative when cooling.  The set-points are those of an ordinary
# office: 21 and 24 degC on working days, 15.6 and 26.7 degC otherwise.
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skhybrid import HybridPredictor
from skhybrid.datasets import load_small_office

office = load_small_office()
X, setpoints = office.X, office.frame[["set_heat", "set_cool"]]
train = X["2018-09-03":"2018-10-14"]
setpoints["2018-10-15":"2018-10-15"].iloc[[0, 24, 32, 84, 95]]

# %%
# The forecast
# ------------
# The model is fitted on six autumn weeks in which the plant mostly cooled.  It forecasts four weeks later, when the
# plant heats; the rows in between are its history.  A day's forecast reads no measurement after the midnight at which
# it starts.
model = HybridPredictor(random_state=0).fit(train, train["T_za"])
later, last = X["2018-10-15":"2018-11-16"], slice("2018-11-12", "2018-11-16")
band = setpoints.loc[later.index]
load = model.predict_load(later, band)
load[last].resample("1D")[["Q_hvac"]].agg(["min", "mean", "max"]).round(1)

# %%
# A pair of columns is a band: between the two set-points the load is zero, and the temperature floats.  The step of the
# heating set-point in the morning is met within one row and causes the peak of the day.
fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(9, 6), layout="constrained")
fig.suptitle("Temperature and load of five days between two set-points")
time = later[last].index
above.fill_between(time, band[last]["set_heat"], band[last]["set_cool"], step="post", color="#eeeeee", label="band")
above.plot(time, later[last]["T_za"], color="black", label="measured")
above.plot(time, load[last]["T_za"], color="tab:blue", label="forecast")
above.set_ylabel("zone temperature [degC]")
above.legend(loc="lower right", ncols=3)
hourly = pd.DataFrame({"measured": later["Q_hvac"], "forecast": load["Q_hvac"]}).resample("1h").mean()
below.step(hourly[last].index, hourly[last]["measured"], where="post", color="black", label="measured")
below.step(hourly[last].index, hourly[last]["forecast"], where="post", color="tab:blue", label="forecast")
below.set_ylabel("heat, hourly means [kW]")
below.legend(loc="upper right", ncols=2)
below.set_xlabel("local time")
fig.autofmt_xdate()

# %%
# How good it is
# --------------
# The measured heat is that of five zones, some of which are cooled while the mean temperature floats in the band.  A
# model of one zone cannot know that, so only the heating is compared, over all days since the training.  The baseline
# is the same hour one week before.
heating = hourly.clip(lower=0.0)
week = 7 * 24
guesses = pd.DataFrame({"forecast": heating["forecast"], "a week before": heating["measured"].shift(week)})[week:]
errors = guesses.sub(heating["measured"][week:], axis=0)
pd.DataFrame(
    {
        "hourly, RMSE [kW]": (errors**2).mean() ** 0.5,
        "daily sum, RMSE [kWh]": (errors.resample("1D").sum() ** 2).mean() ** 0.5,
        "bias [kW]": errors.mean(),
    }
).round(2)

# %%
# A smaller plant
# ---------------
# The same days with a heater of 9 kW that is off from eight in the evening until four in the morning, and no cooling.
# Limits are numbers or one value per row.  ``T_za`` shows which mornings would be cold, and ``Q_hvac_unclipped`` the
# heat that would have met the set-point.
night = (later.index.hour >= 20) | (later.index.hour < 4)
small = model.predict_load(later, band, limits=(0.0, np.where(night, 0.0, 9.0)))

fig, (above, below) = plt.subplots(2, 1, sharex=True, figsize=(9, 6), layout="constrained")
fig.suptitle("The same days with a small plant that is off at night")
above.fill_between(time, band[last]["set_heat"], band[last]["set_cool"], step="post", color="#eeeeee", label="band")
above.plot(time, load[last]["T_za"], color="tab:blue", label="as it is")
above.plot(time, small[last]["T_za"], color="tab:orange", label="9 kW, off at night")
above.set_ylabel("zone temperature [degC]")
above.legend(loc="lower right", ncols=3)
below.step(time, load[last]["Q_hvac"], where="post", color="tab:blue", label="as it is")
below.step(time, small[last]["Q_hvac"], where="post", color="tab:orange", label="9 kW, off at night")
below.set_ylabel("heat [kW]")
below.legend(loc="upper right", ncols=2)
below.set_xlabel("local time")
fig.autofmt_xdate()

# %%
# Degree-hours below the heating set-point, by day.
short = (band["set_heat"] - small["T_za"]).clip(lower=0.0)[last]
(short.resample("1D").sum() / 4).round(1).rename("K h below")
