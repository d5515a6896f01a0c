"""
The paper's identification study
================================

Section 2 of the paper on one office: four ways to identify a room whose occupants nobody counts, and what each is good
for.  The office is simulated, so everything can be compared with the truth.  :doc:`/results/paper` has the same over
several seeds, with a verdict on each statement of the paper.
"""

# %%
# The office
# ----------
# The paper's two-node network under a thermostat, in a July of Oakland; the set-point of the first weekend is
# perturbed.  The first seven days are for training.
import warnings

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skhybrid import GrayBoxRC, InputDisturbanceID, OutputDisturbanceID, PeriodicDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.exceptions import ScaleNotIdentifiableWarning
from skhybrid.identification import make_state_space
from skhybrid.inspection import BodeDisplay, DisturbanceWeekDisplay, StepResponseDisplay

office = make_office(n_days=16, climate="oakland", random_state=2000)
n_train = 7 * 96
X, y, gain = office.X, office.y, office.heat_gain
X_train, y_train, X_test, y_test = X[:n_train], y[:n_train], X[n_train:], y[n_train:]

# %%
# The scale is not identifiable
# -----------------------------
# Multiply every capacitance, window and capacity by a factor and divide every resistance by it: no temperature
# changes.  Starts of the search therefore reach the same loss with different capacities.
with warnings.catch_warnings():
    warnings.simplefilter("ignore", ScaleNotIdentifiableWarning)
    raw = OutputDisturbanceID(n_starts=10, random_state=0).fit(X_train, y_train)
raw.starts_[["loss", "Q_h", "C_w", "R_zo"]].round(3)

# %%
# Table 1 of the paper
# --------------------
# So the scale is fixed by the capacity on the nameplate, and the paper's numbers are rescaled to the same capacity.
nameplate = {"Q_h": office.theta["Q_h"]}  # kW
models = {
    "CONV": GrayBoxRC(known=nameplate, n_starts=10, random_state=0),
    "ID": InputDisturbanceID(known=nameplate, n_starts=10, random_state=0),
    "OD": OutputDisturbanceID(known=nameplate, n_starts=10, random_state=0),
    "Periodic": PeriodicDisturbanceID(known=nameplate, random_state=0),
}
for model in models.values():
    model.fit(X_train, y_train)

table = pd.DataFrame({"true": office.theta, **{label: model.theta_ for label, model in models.items()}})
printed = {
    "CONV": [40, 0.4, 6.2, 40, 1.0, 1.1, 1.5, -1.3],
    "ID": [20.6, 1.4, 0.8, 3.4, 0.03, 20, 6.7, -8.7],
    "OD": [10.6, 1.3, 0.8, 4.1, 0.2, 12.4, 6.7, -8.6],
}
power = pd.Series({name: {"R": -1, "f": 0}.get(name[0], 1) for name in table.index})
for label, numbers in printed.items():
    paper = pd.Series(numbers, table.index, dtype=float)
    table[f"paper's {label}"] = paper * (nameplate["Q_h"] / paper["Q_h"]) ** power
table.round(2)

# %%
# Bode magnitudes
# ---------------
# The gain of the room temperature from each input, by frequency.  All models agree on heating and cooling within hours;
# they differ in the sun, the outdoor temperature, and whatever lasts for days.
true = make_state_space("2R2C", office.theta)
bode = BodeDisplay.from_estimator(models, truth=true)
bode.figure_.suptitle("Bode magnitudes", x=0.99, ha="right")

# %%
# Step responses over 12 hours
# ----------------------------
# By how much the temperature changes after a step of each input.
steps = StepResponseDisplay.from_estimator(models, truth=true, duration="12h")
steps.figure_.suptitle("Step responses", x=0.99, ha="right")

# %%
# Three days ahead, the gain given
# --------------------------------
# With all parameters known, a fit only finds the initial state, and the heat gain may be an input.  This tests a
# network without any model of the disturbance.
thetas = {"true": office.theta, **{label: model.theta_.to_dict() for label, model in models.items()}}
informed = X.assign(Q_gain=gain)
with_gain = pd.DataFrame({"measured": y_test})
for label, theta in thetas.items():
    network = GrayBoxRC(known=theta, horizon="3D").fit(informed[:n_train], y_train)
    with_gain[label] = network.predict(informed[n_train:])


def draw_days(frame, ylabel, title):
    """Draw one line per column, the first in black."""
    figure, axes = plt.subplots(figsize=(9, 3.8), layout="constrained")
    figure.suptitle(title)
    frame.plot(ax=axes, color=["black", "#999999", "#0072B2", "#D55E00", "#009E73", "#CC79A7"], linewidth=1.2)
    axes.set_ylabel(ylabel)
    axes.legend(ncols=6, loc="lower left", bbox_to_anchor=(0, 1), frameon=False)


draw_days(with_gain, "zone temperature [degC]", "Three days ahead, the heat gain given")

# %%
# Root mean square errors [K].
errors = with_gain.drop(columns="measured").sub(with_gain["measured"], axis=0)
errors.pow(2).mean().pow(0.5).round(2)

# %%
# The runtime that holds the measured temperature
# -----------------------------------------------
# Each network is inverted, with the gain given (Eq. 16 of the paper).  The plot shows hourly means of the cooling
# runtime.
plain = {label: GrayBoxRC(known=theta, horizon="1D").fit(X_train, y_train) for label, theta in thetas.items()}
runtime = pd.DataFrame({"measured": X_test["u_cool"].resample("1h").mean()})
for label, network in plain.items():
    load = network.required_heat(X_test, y_test, [0], gain[n_train:].to_numpy()[None])
    runtime[label] = np.minimum(load["Q_hvac_unclipped"].resample("1h").mean(), 0) / thetas[label]["Q_c"]
draw_days(runtime, "cooling runtime [-]", "Cooling that holds the measured temperature")

# %%
# A day ahead, the gain unknown
# -----------------------------
# Even the true parameters cannot make up for heat that nobody forecasts.
without = pd.DataFrame({"measured": y_test, **{label: network.predict(X_test) for label, network in plain.items()}})
draw_days(without, "zone temperature [degC]", "A day ahead, the heat gain unknown")

# %%
# Root mean square errors [K].
errors = without.drop(columns="measured").sub(without["measured"], axis=0)
errors.pow(2).mean().pow(0.5).round(2)

# %%
# The week of the estimated disturbance
# -------------------------------------
# Each network is inverted: this is the heat that explains the measured temperature, beside the true gain.
fig, axes = plt.subplots(3, 1, figsize=(9, 8), sharex=True, layout="constrained")
fig.suptitle("Estimated disturbance of a week")
for ax, label in zip(axes, ("true", "Periodic", "CONV"), strict=True):
    DisturbanceWeekDisplay.from_estimator(plain[label], X, truth=gain, ax=ax, title=f"parameters: {label}")
