"""
A planned day, and what happened
================================

A model-predictive controller plans the heat of an office with the affine forecast of the hybrid.  Every half hour it
measures, plans the next day anew, and sends the thermostat a set-point.  The office is simulated, with people of whom
the controller knows nothing, so that plan and outcome can be compared, and the cost with that of thermostats.
"""

# %%
# The office
# ----------
# Three winter weeks of an ordinary log; the five working days after them are for the controllers.  ``make_office`` also
# returns what no log has: the network, the heat of people, plugs and lights, and the conductance of the air exchange.
import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skhybrid import HybridPredictor
from skhybrid.datasets import make_office
from skhybrid.identification import make_state_space

FIRST, LAST = "2023-01-30", "2023-02-03"
ROW = pd.Timedelta("30min")
PER_ROW = 6  # steps of 5 min, in which the office is simulated
CAPACITY = 6.0  # kW, heating and cooling


def half_hours(office):
    """Log (n, 4) of the heat pump's thermostat by half hours."""
    X = office.X.assign(Q_hvac=CAPACITY * (office.X["u_heat"] - office.X["u_cool"]))
    means = X[["T_oa", "q_sol", "Q_hvac"]].resample(ROW).mean()
    return means.assign(T_za=X["T_za"])


class Office:
    """The simulated office from :data:`FIRST` on, with its on/off thermostat."""

    def __init__(self, office, first=FIRST, last=LAST):
        network = make_state_space("2R2C", office.theta, sampling_time="5min")
        rows = slice(first, last)
        self.A, self.B = network.A, network.B
        self.state = office.states[rows].iloc[0].to_numpy()
        self.weather = office.X.loc[rows, ["T_oa", "q_sol"]].to_numpy()
        air = office.gain_parts["air"] / (office.X["T_oa"] - office.states["T_za"])
        self.air, self.sensible = air[rows].to_numpy(), (office.heat_gain - office.gain_parts["air"])[rows].to_numpy()
        self.too_warm = office.setpoints.loc[rows, "T_cool_set"].to_numpy()
        self.noise = (office.X["T_za"] - office.states["T_za"])[rows].to_numpy()  # of the thermometer
        self.step, self.heating, self.cooling, self.log = 0, False, False, []

    def measured(self):
        """Room temperature by the thermometer [degC]."""
        return self.state[1] + self.noise[self.step]

    def run(self, setpoint):
        """Five minutes under a set-point for heating."""
        k, T = self.step, self.state[1]
        self.heating = T < setpoint + (0.3 if self.heating else -0.3)
        self.cooling = not self.heating and T > self.too_warm[k] + (-0.3 if self.cooling else 0.3)
        T_oa, q_sol = self.weather[k]
        gain = self.sensible[k] + self.air[k] * (T_oa - T)
        self.log.append([T, CAPACITY * self.heating, CAPACITY * self.cooling])
        self.state = self.A @ self.state + self.B @ [T_oa, q_sol, self.heating, self.cooling, gain]
        self.step += 1


# %%
# Cost and comfort
# ----------------
# The heat pump's coefficient of performance falls with the outdoor temperature, and electricity is dearer in the
# morning and in the evening.  The room should have 20 degC from 8 to 18 h.


def comfort_of(index):
    """Least room temperature [degC]."""
    return np.where((index.hour >= 8) & (index.hour < 18), 20.0, 15.0)


def price_of(weather):
    """Price of a kWh of heat."""
    dear = weather.index.hour.isin([6, 7, 8, 17, 18, 19])
    return np.where(dear, 0.45, 0.25) / np.clip(3.0 + 0.06 * weather["T_oa"].to_numpy(), 1.5, 5.0)


DISCOMFORT = 0.5  # price of a K h
