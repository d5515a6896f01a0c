"""
One plan, three optimisers
==========================

skhybrid forecasts; an optimiser decides what to do with the forecast.  This example plans tomorrow's heat with cvxpy,
with CasADi and with do-mpc (extra ``control``), in a few lines each.
"""

# %%
# The model
# ---------
# A winter log of an office with an on/off thermostat and measured heat.  It ends at the midnight before a Tuesday.
import warnings

import casadi
import cvxpy as cp
import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skhybrid import HybridPredictor
from skhybrid.datasets import make_office

with warnings.catch_warnings(action="ignore"):  # of parts that are not installed and not used
    import do_mpc
casadi.GlobalOptions.setNumpyMode(-1)  # as do-mpc expects

office = make_office(n_days=17, climate="chicago", start="2023-01-08", sampling_time="30min", random_state=0)
X = office.X.assign(Q_hvac=6.0 * office.X["u_heat"] - 6.0 * office.X["u_cool"]).drop(columns=["u_heat", "u_cool"])
future = X["2023-01-24":"2023-01-24"].drop(columns=["T_za", "Q_hvac"])  # weather alone: the heat is to be decided
T_now = X.loc[future.index[0], "T_za"]
train = X[: future.index[0]].iloc[:-1]
model = HybridPredictor(random_state=0).fit(train, train["T_za"])

# %%
# The problem
# -----------
# Heat comes from a heat pump of 6 kW, whose coefficient of performance falls with the outdoor temperature.  The price
# of electricity goes by the clock.  In office hours the room should be at 20 degC or more; each K h below costs
# ``discomfort``, so that there is always a plan.  The quantile offsets turn this limit into a chance constraint: the
# room is to be warm enough in nine cases of ten.
hours, hour = 0.5, future.index.hour
tariff = np.where(hour.isin([6, 7, 8, 17, 18, 19]), 0.45, 0.25)  # per kWh of electricity
price = tariff / np.clip(3.0 + 0.06 * future["T_oa"].to_numpy(), 1.5, 5.0)  # per kWh of heat
discomfort, most = 1.0, 6.0  # per K h, kW
ahead = model.affine_forecast(None, future, T_za=T_now, quantiles=(0.1, 0.9), member="network")
lowest = np.where((hour >= 8) & (hour < 18), 20.0, 16.0) - ahead.offsets[:, 0]
n = len(future)

# %%
# cvxpy
# -----
# The forecast is affine, so the plan is a linear program.  The temperature is a variable of its own, which keeps the
# problem sparse for HiGHS.


def plan_by_cvxpy(ahead):
    """Plan (n,) [kW] with cvxpy and HiGHS."""
    q, room, cold = cp.Variable(n, nonneg=True), cp.Variable(n), cp.Variable(n, nonneg=True)
    cost = hours * (price @ q + discomfort * cp.sum(cold))
    constraints = [room == ahead.free + ahead.gain[:, :, 0] @ q, room + cold >= lowest, q <= most]
    cp.Problem(cp.Minimize(cost), constraints).solve(solver=cp.SCIPY)
    return q.value


# %%
# CasADi
# ------
# :meth:`~skhybrid.hybrid.HybridPredictor.to_state_space` gives the network itself.  A nonlinear cost or plant would go
# here.


def plan_by_casadi(space):
    """Plan (n,) [kW] with the Opti stack of CasADi and IPOPT."""
    opti = casadi.Opti()
    A, B, C, forcing = (casadi.DM(array) for array in (space.A, space.B, space.C, space.forcing.T))
    q, x, cold = opti.variable(n), opti.variable(len(space.x0), n + 1), opti.variable(n)
    opti.subject_to(x[:, 0] == space.x0)
    for k in range(n):
        opti.subject_to(x[:, k + 1] == A @ x[:, k] + B @ q[k] + forcing[:, k])
    opti.subject_to((C @ x[:, :n]).T + cold >= lowest)
    opti.subject_to(opti.bounded(0.0, q, most))
    opti.subject_to(cold >= 0.0)
    opti.minimize(hours * (casadi.dot(price, q) + discomfort * casadi.sum1(cold)))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes", "tol": 1e-10})
    return opti.solve().value(q)


# %%
# do-mpc
# ------
# What changes with time (the forcing, the price, the comfort limit) goes into time-varying parameters.


def plan_by_do_mpc(space):
    """Plan (n,) [kW] with do-mpc."""
    network = do_mpc.model.Model("discrete")
    A, B, C = (casadi.DM(array) for array in (space.A, space.B, space.C))
    x = network.set_variable("_x", "x", (len(space.x0), 1))
    q, cold = network.set_variable("_u", "q"), network.set_variable("_u", "cold")
    by_time = {"forcing": space.forcing, "price": price[:, None], "lowest": lowest[:, None]}
    at = {name: network.set_variable("_tvp", name, (values.shape[1], 1)) for name, values in by_time.items()}
    network.set_rhs("x", A @ x + B @ q + at["forcing"])
    network.setup()

    mpc = do_mpc.controller.MPC(network)
    mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.store_full_solution = n, hours, True
    mpc.settings.supress_ipopt_output()
    mpc.settings.nlpsol_opts["ipopt.tol"] = 1e-10
    mpc.set_objective(mterm=casadi.DM(0), lterm=hours * (at["price"] * q + discomfort * cold))
    mpc.set_rterm(q=0.0, cold=0.0)
    mpc.bounds["lower", "_u", "q"], mpc.bounds["upper", "_u", "q"] = 0.0, most
    mpc.bounds["lower", "_u", "cold"] = 0.0
    mpc.set_nl_cons("warm enough", at["lowest"] - C @ x - cold, ub=0.0)
    rows = mpc.get_tvp_template()
    for k in range(n + 1):
        for name, values in by_time.items():
            rows["_tvp", k, name] = values[min(k, n - 1)]
    mpc.set_tvp_fun(lambda now: rows)
    mpc.setup()
    mpc.x0 = space.x0
    mpc.set_initial_guess()
    mpc.make_step(space.x0)
    return mpc.data.prediction(("_u", "q"))[0, :, 0]


# %%
# The same plan
# -------------
# All three find the same cost.  Where two steps have the same price, plans may divide the heat differently between them
# at the same cost.
space = model.to_state_space(None, future, T_za=T_now)
plans = {
    "cvxpy": plan_by_cvxpy(ahead),
    "CasADi": plan_by_casadi(space),
    "do-mpc": plan_by_do_mpc(space),
}
costs = {}
for name, q in plans.items():
    cold = np.clip(lowest - ahead.temperature(q), 0.0, None)
    costs[name] = {
        "heat [kWh]": hours * q.sum(),
        "energy cost": hours * price @ q,
        "too cold [K h]": hours * cold.sum(),
    }
costs = pd.DataFrame(costs).T
costs["cost"] = costs["energy cost"] + discomfort * costs["too cold [K h]"]
costs.round(4)

# %%
# The heat pump runs at night, before the price rises and before people come.  The plan stays above the comfort limit by
# the margin that the quantiles ask for, which grows with the lead.
figure, (above, middle, below) = plt.subplots(
    3, 1, sharex=True, figsize=(8, 7), layout="constrained", height_ratios=[3, 2, 1]
)
figure.suptitle("The planned day: temperature, heat and price")
comfort = lowest + ahead.offsets[:, 0]
T = ahead.temperature(plans["cvxpy"])
edges = T[:, None] + ahead.offsets
above.fill_between(future.index, *edges.T, color="tab:blue", alpha=0.2, linewidth=0, label="80 % interval")
above.plot(future.index, T, color="tab:blue", label="planned")
above.step(future.index, comfort, where="post", color="black", linestyle="--", label="comfort limit")
above.set_ylabel("room [degC]")
above.legend(loc="upper right", ncols=3)
for (name, q), width, dashes in zip(plans.items(), (5.0, 3.0, 1.2), ("-", "--", "-"), strict=True):
    middle.step(future.index, q, where="post", linewidth=width, linestyle=dashes, label=name)
middle.set_ylabel("heat [kW]")
middle.legend(loc="upper right", ncols=3)
below.step(future.index, price, where="post", color="tab:red")
below.set_ylabel("price\n[per kWh of heat]")
below.set_xlabel("local time")
below.xaxis.set_major_formatter(plt.matplotlib.dates.DateFormatter("%H:%M"))
plt.show()
