"""
Three rooms with open doors
===========================

Rooms warm each other.  This example takes the log of a simulated house with open doors, forecasts tomorrow for each
room by itself and with its neighbours, and shows who warms whom.
"""

# %%
# The house
# ---------
# A living room with doors to a kitchen and a bedroom.  Each room has windows, a heater, set-points and people of its
# own.  The log has three weeks in steps of an hour.  The columns of a room end with its name; the heat [kW] replaces
# the stages.
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skhybrid import BuildingPredictor, HybridPredictor
from skhybrid.datasets import make_house

house = make_house(22, zones=3, start="2023-11-27", partition=3.0, sampling_time="1h", random_state=0)
X = house.X[[name for name in house.X if not name.startswith("u_heat_")]].join(house.heat)
y = house.y
rooms = ["living", "kitchen", "bedroom"]
X.iloc[[8, 12, 20]].T.round(2)

# %%
# The forecast
# ------------
# A building is learned from one table.  ``purpose="plan"`` asks for the right response to a kW.  ``shares_`` says how
# much the forecast with neighbours counts, by room and by lead:
n_train = 14 * 24
building = BuildingPredictor(HybridPredictor(purpose="plan"), adjacency=house.adjacency)
building.fit(X[:n_train], y[:n_train])
building.shares_.round(2)

# %%
# The error [K] of forecasts a day ahead, over origins every five hours of the week after the training.  ``own_`` has
# the predictor of each room by itself.
later, measured = X[n_train:], y[n_train:].to_numpy()
origins = np.arange(-1, len(later) - 25, 5)
true = measured[origins[:, None] + np.arange(1, 25)]
alone = np.stack([building.own_[room].predict_from(later, origins) for room in rooms], axis=-1)
forecasts = {"by itself": alone, "with neighbours": building.predict_from(later, origins)}
pd.DataFrame({name: np.sqrt(np.mean((T - true) ** 2, axis=(0, 1))) for name, T in forecasts.items()}, rooms).round(2)

# %%
# Tomorrow, from the last row of the training, with 80 % intervals.
tomorrow = later[:24].drop(columns=list(y))
both = building.forecast(None, tomorrow, quantiles=(0.1, 0.9))
figure, axes = plt.subplots(len(rooms), sharex=True, figsize=(8, 7), layout="constrained")
figure.suptitle("Tomorrow in three rooms, alone and with neighbours")
for ax, room in zip(axes, rooms, strict=True):
    own = building.own_[room].forecast(None, tomorrow)
    band = both[f"q_0.1_{room}"], both[f"q_0.9_{room}"]
    ax.fill_between(both.index, *band, color="tab:blue", alpha=0.2, label="80 % interval")
    ax.plot(later[f"T_za_{room}"][:24], color="black", label="measured")
    ax.plot(both[f"T_za_{room}"], color="tab:blue", label="with neighbours")
    ax.plot(own["T_za"], color="tab:orange", linestyle="--", label="by itself")
    ax.set_ylabel(f"{room} [degC]")
axes[0].legend(ncols=4, loc="lower left", bbox_to_anchor=(0, 1), frameon=False)
axes[-1].set_xlabel("local time")
figure.autofmt_xdate()

# %%
# Who warms whom
# --------------
# The forecast is affine in the heat of all rooms, so one number says what a kW in one room does to another: here, how
# much the temperature has changed after one kW for four hours.
affine = building.affine_forecast(None, tomorrow)
forecast = affine.gain[4, :4].sum(axis=0)  # (room that is heated, room that warms) [K]

# %%
# The same in the simulated house, whose network is known:
heat = house.network.inputs(affine.inputs)
network = house.network.discrete(house.theta, heat, dt=1.0)  # steps of 1 h
states = np.zeros((len(house.network.states), len(heat)))
for _ in range(4):
    states = network.A @ states + network.B[:, : len(heat)]
states = pd.DataFrame(states, house.network.states, heat)
warmed = states.loc[list(y), list(affine.inputs)].to_numpy().T

# %%
# The forecast blends in the forecast of each room by itself, in which a room has no effect on others.  So it shows a
# smaller effect on neighbours, and none beyond the next room.
figure, axes = plt.subplots(1, 2, figsize=(8, 3.6), sharey=True, layout="constrained")
for ax, title, after in zip(axes, ("forecast", "simulated house"), (forecast, warmed), strict=True):
    image = ax.imshow(after, cmap="Oranges", vmin=0.0, vmax=2.0)
    for (i, j), value in np.ndenumerate(after):
        ax.text(j, i, f"{value:.2f}", ha="center", va="center", color="white" if value > 1.0 else "black")
    ax.set_title(title)
    ax.set_xticks(range(len(rooms)), rooms)
    ax.set_yticks(range(len(rooms)), rooms)
    ax.set_xlabel("room that warms")
axes[0].set_ylabel("room that is heated")
figure.colorbar(image, ax=axes, label="after 1 kW for 4 h [K]")
plt.show()
