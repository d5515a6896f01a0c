"""
A planned day, and what happened
================================

A predictive controller plans the heat of an office with the affine forecast of the hybrid.  Every half hour it measures
the room, plans the next day anew, and sends the thermostat a set-point.  The office is simulated, with people of whom
the controller knows nothing.  The example shows the plan, what happened, and what a thermostat alone would have cost.
"""

# %%
# The office
# ----------
# Three winter weeks of an ordinary log, and the five working days after them, which are for the controllers.  Besides
# the log, ``make_office`` returns what no log has: the network, the heat gains, and the conductance of the air
# exchange.
import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skhybrid import HybridPredictor
from skhybrid.datasets import make_office
from skhybrid.identification import make_state_space

WEEK = slice("2023-01-30", "2023-02-03")
CAPACITY = 6.0  # of heating and of cooling [kW]


class Office:
    """The simulated office over some rows of its log, with its on/off thermostat; steps of 5 min."""

    def __init__(self, office, rows):
        network = make_state_space("2R2C", office.theta, sampling_time="5min")
        self.A, self.B, self.state = network.A, network.B, office.states[rows].iloc[0].to_numpy()
        air = office.gain_parts["air"] / (office.X["T_oa"] - office.states["T_za"])  # kW/K
        sensible = office.heat_gain - office.gain_parts["air"]
        given = [office.X["T_oa"], office.X["q_sol"], sensible, air, office.setpoints["T_cool_set"]]
        self.given = pd.concat(given, axis=1)[rows].to_numpy()
        self.noise = (office.X["T_za"] - office.states["T_za"])[rows].to_numpy()  # of the thermometer
        self.index, self.log, self.heating, self.cooling = office.X[rows].index, [], False, False

    def measured(self):
        """Room temperature by the thermometer [degC]."""
        return self.state[1] + self.noise[len(self.log)]

    def hold(self, setpoints):
        """Go on under set-points for heating [degC], one per step; return the mean heat [kW]."""
        for setpoint in setpoints:
            T_oa, q_sol, sensible, air, warmest = self.given[len(self.log)]
            room = self.state[1]
            self.heating = room < setpoint + (0.3 if self.heating else -0.3)
            self.cooling = not self.heating and room > warmest + (-0.3 if self.cooling else 0.3)
            self.log.append([room, CAPACITY * self.heating, CAPACITY * self.cooling])
            gain = sensible + air * (T_oa - room)
            self.state = self.A @ self.state + self.B @ [T_oa, q_sol, self.heating, self.cooling, gain]
        _, heating, cooling = np.mean(self.log[-len(setpoints) :], axis=0)
        return heating - cooling

    def record(self):
        """Temperature [degC], heating and cooling [kW] so far."""
        return pd.DataFrame(self.log, self.index[: len(self.log)], ["T_za", "heating", "cooling"])


def draw(seed):
    """An office and its log by half hours."""
    office = make_office(27, "chicago", start="2023-01-09", excitation=None, sampling_time="5min", random_state=seed)
    X = office.X.assign(Q_hvac=CAPACITY * (office.X["u_heat"] - office.X["u_cool"]))
    means = X[["T_oa", "q_sol", "Q_hvac"]].resample("30min").mean()
    return office, means.assign(T_za=X["T_za"])


# %%
# Under its own set-points the simulated office does what the log says.
office, X = draw(0)
thermostat = Office(office, WEEK)
thermostat.hold(office.setpoints.loc[WEEK, "T_heat_set"])
print(f"largest difference: {(thermostat.record()['T_za'] - office.states['T_za']).abs().max():.1e} K")

# %%
# Cost and comfort
# ----------------
# The coefficient of performance of the heat pump falls with the outdoor temperature, and electricity is expensive in
# the morning and in the evening.  Between 8 and 18 h the room should be at 20 degC or more.
DISCOMFORT = 0.5  # price of a K h


def comfort_of(index):
    """Least room temperature [degC]."""
    return np.where((index.hour >= 8) & (index.hour < 18), 20.0, 15.0)


def price_of(weather):
    """Price of a kWh of heat."""
    tariff = np.where(weather.index.hour.isin([6, 7, 8, 17, 18, 19]), 0.45, 0.25)
    return tariff / np.clip(3.0 + 0.06 * weather["T_oa"].to_numpy(), 1.5, 5.0)


def account(plant, office):
    """What some days cost."""
    record = plant.record()
    heat = record["heating"] + record["cooling"]
    cold = np.clip(comfort_of(record.index) - record["T_za"], 0.0, None)
    energy = price_of(office.X.loc[record.index]) @ heat / 12
    return {
        "heat [kWh]": heat.sum() / 12,
        "energy cost": energy,
        "too cold [K h]": cold.sum() / 12,
        "cost": energy + DISCOMFORT * cold.sum() / 12,
    }


# %%
# The controller
# --------------
# A linear program over the next day.  The offsets of the lower quantile make the room warm enough in nine cases of ten.
# While the plan heats, the thermostat gets the temperature that is planned for the end of the half hour; so it corrects
# for what the plan did not foresee.


def plan(ahead, weather):
    """Heat (n,) [kW] over the rows ahead."""
    n = len(weather)
    q, room, cold, warm = (cp.Variable(n, nonneg=True) for _ in range(4))
    cost = 0.5 * (price_of(weather) @ q + DISCOMFORT * cp.sum(cold + warm))
    constraints = [
        room == ahead.free + ahead.gain[:, :, 0] @ q,
        room + ahead.offsets[:, 0] + cold >= comfort_of(weather.index),
        room - warm <= 23.0,
        q <= CAPACITY,
    ]
    cp.Problem(cp.Minimize(cost), constraints).solve(solver=cp.SCIPY)
    return q.value


def control(office, X):
    """Run the predictive controller; return the office and, by stamp, plan and forecast."""
    train = X[X.index < WEEK.start]
    model = HybridPredictor(random_state=0).fit(train, train["T_za"])
    plant, plans = Office(office, WEEK), {}
    for now in X[WEEK].index:
        weather = X.loc[now:, ["T_oa", "q_sol"]].iloc[:48]
        T = plant.measured()
        ahead = model.affine_forecast(None, weather, T_za=T, quantiles=(0.1, 0.9))
        q = plan(ahead, weather)
        plans[now] = q, ahead
        setpoint = ahead.temperature(q)[1] if q[0] > 0.1 else 15.0
        model.update(weather.iloc[[0]].assign(Q_hvac=plant.hold([setpoint] * 6), T_za=T))
    return plant, plans


planned, plans = control(office, X)

# %%
# One day
# -------
# The plan of Wednesday as it was at midnight, with its interval, and what happened.  The plan was made anew every half
# hour, so the room follows the midnight plan only as long as people behave as on an average day.
midnight = pd.Timestamp("2023-02-01")
q, ahead = plans[midnight]
day = slice(midnight, ahead.index[-1])
record = planned.record()[day]
figure, (above, middle, below) = plt.subplots(
    3, 1, sharex=True, figsize=(8, 7), layout="constrained", height_ratios=[3, 2, 1]
)
figure.suptitle("A planned day and the day as it went")
T = ahead.temperature(q)
above.fill_between(
    ahead.index, *(T[:, None] + ahead.offsets).T, color="tab:blue", alpha=0.2, lw=0, label="80 % interval"
)
above.plot(ahead.index, T, color="tab:blue", label="planned at midnight")
above.plot(record["T_za"], color="black", label="happened")
above.plot(thermostat.record().loc[day, "T_za"], color="tab:orange", lw=1, label="thermostat alone")
above.step(ahead.index, comfort_of(ahead.index), where="post", color="black", ls="--", lw=1, label="comfort limit")
above.set_ylabel("room [degC]")
middle.step(ahead.index, q, where="post", color="tab:blue", label="planned at midnight")
middle.step(ahead.index, record["heating"].resample("30min").mean(), where="post", color="black", label="happened")
middle.set_ylabel("heat [kW]")
below.step(ahead.index, price_of(X[day]), where="post", color="tab:red")
below.set_ylabel("price\n[per kWh of heat]")
below.set_xlabel("local time")
below.xaxis.set_major_formatter(plt.matplotlib.dates.DateFormatter("%H:%M"))
figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=3)
plt.show()

# %%
# What it was worth
# -----------------
# One office and one day prove nothing.  Here are the five days in three offices, whose people differ.  A better
# schedule of set-points may do as well, so a rule is compared too: one level from some hour until 6 h, and another
# until 18 h.  The rule is the best of a grid, tried on the simulated office in the week before; nobody could do that in
# a real building.


def by_rule(office, rows, start, before, during):
    """The office under a daily rule."""
    plant = Office(office, rows)
    hour = plant.index.hour
    plant.hold(np.where((hour >= start) & (hour < 6), before, np.where((hour >= 6) & (hour < 18), during, 15.0)))
    return plant


def best_rule(office, rows):
    """The best of a grid of rules."""
    grid = [(start, before, during) for start in (2, 4, 5) for before in (20.5, 21.5, 23.0) for during in (20.0, 20.4)]
    return min(grid, key=lambda rule: account(by_rule(office, rows, *rule), office)["cost"])


rows = {}
for seed in range(3):
    if seed:
        office, X = draw(seed)
        thermostat = Office(office, WEEK)
        thermostat.hold(office.setpoints.loc[WEEK, "T_heat_set"])
        planned, _ = control(office, X)
    rule = by_rule(office, WEEK, *best_rule(office, slice("2023-01-23", "2023-01-27")))
    for name, plant in {"thermostat": thermostat, "best rule": rule, "predictive": planned}.items():
        rows[f"office {seed}", name] = account(plant, office)
table = pd.DataFrame(rows).T.rename_axis(["", "controller"])
print(table.round(1).to_string())

# %%
# The sum of the fifteen days.
print(table.groupby("controller").sum().round(1).to_string())

# %%
# The weather was known in advance, which favours the predictive controller, and the simulated office is a network like
# that of the model.  In both respects a real building is harder.
