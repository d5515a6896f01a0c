"""
Two rooms, two thermometers, two unmeasured gains
=================================================

A network is declared, not programmed: its nodes and resistors, and which nodes are measured, heated and disturbed.
Here two rooms share a wall.  Each has its own window, heater and people.  Both temperatures are fitted together.
"""

# %%
# The network
# -----------
import numpy as np
import pandas as pd

from skhybrid import InputDisturbanceID, RCNetwork
from skhybrid.datasets import make_prbs, make_weather

rooms = ("north", "south")
flat = RCNetwork(
    "two rooms",
    capacitances={"wall_n": "C_wn", "wall_s": "C_ws", "north": "C_n", "south": "C_s"},
    resistors={
        "R_nw": ("north", "wall_n"),
        "R_sw": ("south", "wall_s"),
        "R_no": ("north", "T_oa"),
        "R_so": ("south", "T_oa"),
        "R_ns": ("north", "south"),
    },
    solar=rooms,
    measured=rooms,
    disturbed=rooms,
    heated=rooms,
)
flat

# %%
# A log whose truth is known
# --------------------------
# Two weeks in which the heaters follow a pseudo-random sequence and the unmeasured gains drift slowly.  The south room
# gets direct sun from morning to evening, the north room only the diffuse part.
truth = {"C_wn": 4.0, "C_ws": 6.0, "C_n": 0.8, "C_s": 1.2, "R_nw": 1.2, "R_sw": 0.9, "R_no": 8.0, "R_so": 6.0}
truth |= {"R_ns": 2.5, "A_win_north": 1.0, "A_win_south": 3.0, "Q_h_north": 5.0, "Q_h_south": 6.0}

rng = np.random.default_rng(0)
weather = make_weather(14, "chicago", start="2023-11-04", step="15min", random_state=0)
X = pd.DataFrame({"T_oa": weather["T_oa"], "q_sol_north": 0.4 * weather["q_sol"], "q_sol_south": weather["q_sol"]})
hour = X.index.hour + X.index.minute / 60
X["q_sol_south"] *= np.clip(np.sin((hour - 5) / 15 * np.pi), 0, None)
for k, (room, scale) in enumerate(zip(rooms, ("2h", "3h"), strict=True)):
    X[f"u_heat_{room}"] = make_prbs(6, scale, duration="14D", step="15min", low=0.1, high=0.9, random_state=k)

discrete = flat.discrete(truth, X.columns, dt=0.25)  # steps of 15 min
inputs = X[list(flat.inputs(X.columns))].to_numpy()
gain, T = np.empty((len(X), 2)), np.empty((len(X), 2))  # [kW], [degC]
level, state = np.full(2, 0.3), np.full(4, 18.0)
for k in range(len(X)):
    level = 0.99 * level + rng.normal(0.0, 0.05, 2)
    gain[k], T[k] = level, state[[2, 3]]
    state = discrete.A @ state + discrete.B @ [*inputs[k], *gain[k]]
X[["T_north", "T_south"]] = T + rng.normal(0.0, 0.03, T.shape)

# %%
# The fit
# -------
# One nameplate capacity fixes the scale.  ``y`` has one column per measured room.
model = InputDisturbanceID(flat, known={"Q_h_north": 5.0}, n_starts=20, random_state=0)
model.fit(X, X[["T_north", "T_south"]])
print(model.identifiability_)
comparison = pd.DataFrame({"truth": truth, "found": model.theta_, "std": model.theta_std_})
comparison["error %"] = 100 * (comparison["found"] / comparison["truth"] - 1)
comparison.round(2)

# %%
# The two gains
# -------------
# The unmeasured heat of each room is estimated separately.
import matplotlib.pyplot as plt

zeta = model.estimate_disturbance(X, smooth=True)
figure, axes = plt.subplots(2, sharex=True, layout="constrained")
figure.suptitle("Unmeasured heat of two rooms, estimated and true")
for ax, room, true in zip(axes, rooms, gain.T, strict=True):
    ax.plot(X.index, true, color="0.6", label="true")
    ax.plot(X.index, zeta[f"zeta_{room}"], label="estimated")
    ax.set_ylabel(f"gain {room} [kW]")
axes[0].legend()
axes[-1].set_xlabel("local time")
figure.autofmt_xdate()
plt.show()
