"""
Three rooms with open doors
===========================

Rooms warm each other.  This example simulates three rooms in a row with open doors, forecasts tomorrow for each room by
itself and with its neighbours, and shows who warms whom.
"""

# %%
# The house
# ---------
# A network of three rooms, each with air and walls, and a door to the next one.
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skhybrid import BuildingPredictor, HybridPredictor, RCNetwork
from skhybrid.datasets import make_weather

rooms = ["bedroom", "hall", "study"]
doors = [("bedroom", "hall"), ("hall", "study")]
resistors = {f"R_{a}_{b}": (a, b) for a, b in doors}
for room in rooms:
    resistors |= {f"R_{room}_wall": (room, f"wall_{room}"), f"R_{room}_out": (room, "T_oa")}
house = RCNetwork(
    "house",
    capacitances={f"wall_{room}": f"C_wall_{room}" for room in rooms} | {room: f"C_{room}" for room in rooms},
    resistors=resistors,
    solar=rooms,
    measured=rooms,
    disturbed=rooms,
    heated=rooms,
)
house

# %%
# Three weeks of its log
# ----------------------
# Each room has a thermostat with hours of its own, and heat that nobody measures; the set-points differ from day
# to day.
values = {"door": 3.0, "wall": 2.0, "out": 16.0}  # K/kW
theta = {name: values.get(name.rpartition("_")[2], values["door"]) for name in resistors}
theta |= {f"C_wall_{room}": 4.0 for room in rooms} | {f"C_{room}": 0.5 for room in rooms}
theta |= {f"A_win_{room}": 1.5 for room in rooms}

rng = np.random.default_rng(0)
n_days = 22
weather = make_weather(n_days, "chicago", start="2023-11-27", step="15min", random_state=0)
X = weather[["T_oa"]].join(
    pd.DataFrame({f"q_sol_{r}": s * weather["q_sol"] for r, s in zip(rooms, (0.3, 0.1, 0.6), strict=True)})
)
hour, day = X.index.hour.to_numpy(), np.arange(len(X)) // 96
heat = [f"Q_hvac_{room}" for room in rooms]
network = house.discrete(theta, [*X, *heat], dt=0.25)
wanted = np.array([21.0, 19.0, 21.0]) - np.array([3.0, 1.0, 5.0]) * (hour[:, None] < [6, 7, 8])
wanted += rng.uniform(-2.0, 2.0, (n_days, 3))[day]
gain = np.column_stack([0.6 * ((hour > 16) & (hour < 22)), 0.05 + 0.0 * hour, 0.3 * ((hour > 8) & (hour < 17))])
gain *= rng.uniform(0.5, 1.5, (n_days, 3))[day]

state, T, Q = np.full(6, 18.0), np.empty((len(X), 3)), np.empty((len(X), 3))
for k, outside in enumerate(X.to_numpy()):
    T[k] = state[3:]
    Q[k] = np.clip(1.5 * (wanted[k] - T[k]), 0.0, 2.5)
    state = network.A @ state + network.B @ [*outside, *Q[k], *gain[k]]
X[heat] = Q
X = X.resample("1h").mean()
y = pd.DataFrame(T + rng.normal(0.0, 0.03, T.shape), X.index.repeat(4), [f"T_za_{room}" for room in rooms])[::4]
X = X.join(y)

# %%
# The forecast
# ------------
# A building is learned from one table; the columns of a room end with its name.  ``purpose="plan"`` asks for the right
# response to a kW.  How much the forecast with neighbours counts, by room and by lead:
n_train = 14 * 24
building = BuildingPredictor(HybridPredictor(purpose="plan"), adjacency=doors).fit(X[:n_train], y[:n_train])
building.shares_.round(2)

# %%
# The error [K] of forecasts a day ahead, over origins every five hours of the week after the training.  ``own_`` has
# the predictor of each room by itself.
later, measured = X[n_train:], y[n_train:].to_numpy()
origins = np.arange(-1, len(later) - 25, 5)
true = measured[origins[:, None] + np.arange(1, 25)]
alone = np.stack([building.own_[room].predict_from(later, origins) for room in rooms], axis=-1)
paths = {"by itself": alone, "with neighbours": building.predict_from(later, origins)}
pd.DataFrame({name: np.sqrt(np.mean((path - true) ** 2, axis=(0, 1))) for name, path in paths.items()}, rooms).round(2)

# %%
# Tomorrow, from the last row of the training, with 80 % intervals.
tomorrow = later[:24].drop(columns=list(y))
both = building.forecast(None, tomorrow, quantiles=(0.1, 0.9))
figure, axes = plt.subplots(len(rooms), sharex=True, figsize=(8, 7), layout="constrained")
figure.suptitle("Tomorrow in three rooms, alone and with neighbours")
for ax, room in zip(axes, rooms, strict=True):
    own = building.own_[room].forecast(None, tomorrow)
    ax.fill_between(
        both.index, both[f"q_0.1_{room}"], both[f"q_0.9_{room}"], color="tab:blue", alpha=0.2, label="80 % interval"
    )
    ax.plot(later[f"T_za_{room}"][:24], color="black", label="measured")
    ax.plot(both[f"T_za_{room}"], color="tab:blue", label="with neighbours")
    ax.plot(own["T_za"], color="tab:orange", linestyle="--", label="by itself")
    ax.set_ylabel(f"{room} [degC]")
axes[0].legend(ncols=4, loc="lower left", bbox_to_anchor=(0, 1), frameon=False)
figure.autofmt_xdate()

# %%
# Who warms whom
# --------------
# The forecast is affine in the heat of all rooms, so one number says what a kW in one room does to another: here the
# change of temperature after a kW for four hours, and the same in the simulated house.  The forecast shows a smaller
# effect, because it is a blend with the forecast of each room by itself, and no effect beyond the next room.
affine = building.affine_forecast(None, tomorrow)
forecast = affine.gain[4, :4].sum(axis=0)  # (room that is heated, room that warms) [K]
states = np.zeros((6, 3))
for _ in range(16):
    states = network.A @ states + network.B[:, 4:7]
figure, axes = plt.subplots(1, 2, figsize=(8, 3.6), sharey=True, layout="constrained")
for ax, title, after in zip(axes, ("forecast", "simulated house"), (forecast, states[3:].T), strict=True):
    image = ax.imshow(after, cmap="Oranges", vmin=0.0, vmax=states[3:].max())
    for (i, j), value in np.ndenumerate(after):
        ax.text(j, i, f"{value:.2f}", ha="center", va="center", color="white" if value > 0.9 else "black")
    ax.set_title(title)
    ax.set_xticks(range(len(rooms)), rooms)
    ax.set_yticks(range(len(rooms)), rooms)
    ax.set_xlabel("room that warms")
axes[0].set_ylabel("room that is heated")
figure.colorbar(image, ax=axes, label="after 1 kW for 4 h [K]")
plt.show()
