"""The data contract: tables that are read, tables that are refused, the words of a refusal, and tables read once."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from joblib import Parallel, delayed
from sklearn import config_context
from sklearn.base import BaseEstimator, clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.impute import SimpleImputer
from sklearn.model_selection import KFold, train_test_split
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from skhybrid import (
    ARXRegressor,
    BuildingPredictor,
    DisturbanceForecaster,
    GrayBoxRC,
    HybridPredictor,
    PeriodicDisturbanceID,
    SchedulePredictor,
    TwoStagePredictor,
    _table,
)
from skhybrid._clock import Stamps, hour_of_day, joined_stamps
from skhybrid._columns import as_numbers
from skhybrid._holidays import NO_HOLIDAYS, Holidays
from skhybrid._ranges import is_in_watts
from skhybrid._table import (
    ZoneTable,
    append_tables,
    concatenate_tables,
    last_rows,
    read_table,
    read_target,
    role_of,
)
from skhybrid._time import ASSUMED_START, origin_rows, rows_covering, rows_of
from skhybrid._transaction import unchanged_on_failure
from skhybrid.datasets import make_office, make_prbs, make_weather, regularize
from skhybrid.exceptions import ExcitationWarning, RoleWarning, UnitWarning
from skhybrid.forecasting import BoostedRegressor
from skhybrid.forecasting.quantiles import read_quantiles
from skhybrid.identification import frequency_response, make_state_space
from skhybrid.model_selection import RollingOriginSplit, backtest
from skhybrid.preprocessing import FacadeIrradiance, GapFiller, UnitConverter
from skhybrid.study import Settings, split_log

QUARTER = pd.Timedelta("15min")
START = [21.0, 22.0]
INPUTS = ["T_oa", "q_sol", "u_heat", "u_cool"]
#: the office's parameters where the stages are known by position only
BY_POSITION = {"C_w": 4.0, "C_za": 1.0, "R_zw": 1.2, "R_zo": 9.0, "f": 0.3, "A_win": 3.0, "Q_2": 6.0, "Q_3": -6.0}


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=4, random_state=0)


def gray_box(office, X=None, y=None, **settings):
    """A fit with all parameters known, which takes no time."""
    X, y = (office.X if X is None else X), (office.y if y is None else y)
    return GrayBoxRC(**{"known": office.theta, "sampling_time": step_of(X), **settings}).fit(X, y)


def read(X, **settings):
    return read_table(BaseEstimator(), X, **{"reset": True, "sampling_time": step_of(X), **settings})


def step_of(X):
    """The sampling time that an array needs, which has no stamps."""
    return "15min" if isinstance(X, np.ndarray) else None


def stamped(n, start="2023-07-08", step="15min", tz=None, **columns):
    index = pd.date_range(start, periods=n, freq=step, tz=tz)
    return pd.DataFrame({"T_oa": np.linspace(5.0, 10.0, n), **columns}, index=index)


# -------------------------------------------------------------------------------------------------------------- roles
@pytest.mark.parametrize(
    "name", ["T_oa", "T_za", "T_ground", "q_sol", "q_sol_south", "u_heat_2", "u_2", "Q_hvac", "zeta"]
)
def test_names_that_are_roles(name):
    assert role_of(name) == name


@pytest.mark.parametrize("name", ["t_oa", "Toa", "T_", "q_solar", "T_oa ", "u_heat\n", "Temp", 3, None, ("T_oa", "a")])
def test_names_that_are_no_roles(name):
    assert role_of(name) is None


def test_the_same_table_by_name_by_columns_and_by_position(office):
    """Three ways to say the same give the same simulation."""
    X = office.X[INPUTS]
    by_name = gray_box(office, X).simulate(X, initial_state=START)
    renamed = X.rename(columns=dict(zip(INPUTS, ["out", "sun", "heat %", "T_x"], strict=True)))[
        ["sun", "T_x", "out", "heat %"]
    ]
    columns = {"T_oa": "out", "q_sol": "sun", "u_heat": "heat %", "u_cool": "T_x"}
    by_columns = gray_box(office, renamed, columns=columns)
    np.testing.assert_allclose(by_columns.simulate(renamed, initial_state=START), by_name)
    array, y = X.to_numpy(), office.y.to_numpy()
    by_position = gray_box(office, array, y, known=BY_POSITION)
    np.testing.assert_allclose(by_position.simulate(array, initial_state=START), by_name)
    assert list(by_position.theta_.index) == list(BY_POSITION)
    turned = array[:, ::-1]
    columns = {"T_oa": 3, "q_sol": 2, "u_heat": 1, "u_cool": np.int64(0)}
    np.testing.assert_allclose(
        gray_box(office, turned, y, columns=columns).simulate(turned, initial_state=START), by_name
    )


def test_column_order_does_not_matter_to_the_physics(office):
    turned = office.X[office.X.columns[::-1]]
    np.testing.assert_allclose(gray_box(office, turned).simulate(turned), gray_box(office).simulate(office.X))


def test_roles_of_an_array():
    table = read(np.arange(40.0).reshape(8, 5) / 100)
    assert list(table.inputs) == ["T_oa", "q_sol", "u_2", "u_3", "u_4"]
    table = read(np.arange(40.0).reshape(8, 5) / 100, columns={"T_za": 4, "Q_hvac": 2, "q_sol": None})
    assert set(table.inputs) == {"T_oa", "Q_hvac", "u_3"}
    np.testing.assert_array_equal(table.measured(), np.arange(4, 40, 5) / 100)
    assert table.utc is None
    assert table.time[0] == ASSUMED_START
    assert read(np.zeros((8, 2)), sampling_time="1h").step == pd.Timedelta("1h")
    assert read(np.zeros((8, 2)), expected_step=pd.Timedelta("5min"), sampling_time=None).step == pd.Timedelta("5min")


@pytest.mark.parametrize("stamped", [True, False])
def test_frames_of_other_libraries_have_columns_by_name(office, stamped):
    """An Arrow table was fitted by position, with the sun as the outdoor temperature, and predicted by name."""
    pa = pytest.importorskip("pyarrow")
    X, y = office.X[["q_sol", "T_oa", "u_heat", "u_cool", "T_za"]], office.y
    if not stamped:
        X, y = X.reset_index(drop=True), y.reset_index(drop=True)
    tables = pa.table(X), pa.table(X[:50]), pa.chunked_array([y])  # an index of stamps goes with the table
    step = {"sampling_time": "15min"}
    for model in (
        GrayBoxRC(known=office.theta, **step),
        ARXRegressor(**step),
        DisturbanceForecaster("profile", **step),
        TwoStagePredictor(
            GrayBoxRC(known=office.theta), DisturbanceForecaster("profile"), preprocess=GapFiller(**step), **step
        ),
    ):
        expected = clone(model).fit(X, y).predict(X[:50])
        by_arrow = model.fit(tables[0], tables[2])
        assert list(by_arrow.feature_names_in_) == list(X)
        np.testing.assert_array_equal(by_arrow.predict(tables[1]), expected)
        np.testing.assert_array_equal(by_arrow.predict(X[:50]), expected)
        if not isinstance(model, DisturbanceForecaster):
            assert by_arrow.score(tables[1], tables[2][:50]) == by_arrow.score(X[:50], y[:50])


def test_transformers_convert_frames_of_other_libraries(office):
    pa = pytest.importorskip("pyarrow")
    given = pa.table(office.X)
    for step in (GapFiller(), UnitConverter({"T_oa": "K"})):
        pd.testing.assert_frame_equal(step.fit_transform(given), step.fit_transform(office.X), check_freq=False)
    with pytest.raises(ValueError, match=r"its column 'when' holds them, so give X.to_pandas\(\).set_index\('when'\)"):
        ARXRegressor().fit(pa.table(office.X.reset_index(names="when")), office.y.to_numpy())


class Unconvertible:
    """A frame whose library needs another one to convert it."""

    def __len__(self):
        return 384

    def to_pandas(self):
        raise ModuleNotFoundError("pa.Table requires 'pyarrow' module to be installed\nsee the manual")


def test_a_frame_without_an_index_is_told_how_to_get_one(office):
    """The hybrid said X.set_index, which no frame of another library has."""
    pa = pytest.importorskip("pyarrow")
    given = pa.table(office.X.reset_index(names="when"))
    with pytest.raises(ValueError, match=r"give X.to_pandas\(\).set_index\('when'\)"):
        HybridPredictor().fit(given, office.y.to_numpy())


class Uncomputed:
    """A frame of another library that is not computed yet, such as a LazyFrame of polars."""

    def collect(self):
        raise AssertionError


@pytest.mark.parametrize("model", [GrayBoxRC(), ARXRegressor(), HybridPredictor()])
def test_rows_as_mappings_and_frames_that_are_not_computed_are_refused(model, office):
    with pytest.raises(ValueError, match=r"^X is a Uncomputed; give a DataFrame or an array\.$"):
        model.fit(Uncomputed(), office.y)
    with pytest.raises(ValueError, match=r"^X is a list of mappings; make it a table with pd\.DataFrame\.$"):
        model.fit(office.X.to_dict("records"), office.y)


@pytest.mark.parametrize("model", [GrayBoxRC(), ARXRegressor(), HybridPredictor(), GapFiller(), BuildingPredictor()])
def test_a_frame_that_cannot_be_converted_is_refused(model, office):
    words = r"X is a \w+ Unconvertible that cannot be converted to pandas \(pa.Table requires 'pyarrow' module to"
    with pytest.raises(ValueError, match=words):
        model.fit(Unconvertible(), office.y)
    if not isinstance(model, GapFiller):
        with pytest.raises(ValueError, match=r"^(zone 'zone_0': )?y is a \w+ Unconv.*; install pyarrow, or give"):
            model.fit(office.X, Unconvertible())


def test_a_pipeline_may_pass_on_polars_frames(office):
    pytest.importorskip("polars")
    X, y = office.X.reset_index(drop=True), office.y.to_numpy()
    model = make_pipeline(UnitConverter({"T_oa": "degC"}), ARXRegressor(sampling_time="15min"))
    expected = clone(model).fit(X, y).predict(X[:50])
    with config_context(transform_output="polars"):
        np.testing.assert_array_equal(model.fit(X, y).predict(X[:50]), expected)


def test_other_columns_are_left_alone():
    X = stamped(4, note=list("abcd"), Temp=np.nan)
    assert list(read(X, required=["T_oa"]).inputs) == ["T_oa"]


def test_role_that_is_absent_on_purpose(office):
    X = office.X.drop(columns="q_sol")
    with pytest.raises(
        ValueError, match=r"role 'q_sol' is missing: X has 'T_oa', 'u_heat', 'u_cool', 'T_za'.*'q_sol': None"
    ):
        gray_box(office, X)
    model = gray_box(office, X, columns={"q_sol": None})
    assert "A_win" not in model.theta_
    # the role of a column that is there can be taken away just so
    np.testing.assert_allclose(gray_box(office, columns={"q_sol": None}).simulate(office.X), model.simulate(X))


def test_facade_stands_for_the_sun():
    assert list(read(stamped(4, q_sol_south=0.1), required=["T_oa", "q_sol"]).inputs) == ["T_oa", "q_sol_south"]


def test_missing_role_names_the_role_and_the_columns(office):
    with pytest.raises(
        ValueError, match=r"role 'T_oa' is missing: X has 'q_sol', 'u_heat', 'u_cool', 'T_za'; name a column"
    ):
        gray_box(office, office.X.drop(columns="T_oa"))
    many = pd.DataFrame(0.0, index=office.X.index, columns=[f"c{j}" for j in range(30)])
    with pytest.raises(ValueError, match=r"X has 'c0', .*'c11', \.\.\.; name"):
        gray_box(office, many)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"T_oa": "out"}, "gives 'T_oa' the column 'out', but X has 'T_oa'"),
        ({"outdoor": "T_oa"}, "names the role 'outdoor', which is not one of T_oa, q_sol"),
        ({"T_za": "T_oa", "T_oa": "T_oa"}, "gives 'T_za' and 'T_oa' the same column 'T_oa'; give each its own"),
        ({"T_oa": ["T_oa"]}, r"gives 'T_oa' the column \['T_oa'\]; give one name"),
        (["T_oa"], r"columns=\['T_oa'\] must be a mapping of roles to columns"),
    ],
)
def test_columns_that_cannot_be(office, columns, message):
    with pytest.raises(ValueError, match=message):
        gray_box(office, columns=columns)
    for model in (HybridPredictor(columns=columns), SchedulePredictor(columns=columns)):
        with pytest.raises(ValueError, match=message):
            model.fit(office.X, office.y)
    gray = TwoStagePredictor(GrayBoxRC(columns=columns, known=office.theta), DisturbanceForecaster("profile"))
    with pytest.raises(ValueError, match=message):
        gray.fit(office.X, office.y)


@pytest.mark.parametrize("model", [GrayBoxRC(n_starts=1), ARXRegressor(), SchedulePredictor(intervals=False)])
def test_columns_may_change_after_fit_to_those_of_another_table(model, office):
    """Roles are those of the training: a KeyError named one that was not found under the new names."""
    other = office.X.rename(columns={"T_oa": "out"})
    model = clone(model).set_params(columns={"T_oa": "out"}).fit(other, office.y)
    expected = model.predict(other)
    for columns in (None, {"T_oa": "T_oa"}):
        model.set_params(columns=columns)
        with pytest.raises(ValueError, match="X has no column 'T_oa', which the training table has; it has 'out'"):
            model.predict(other)
        np.testing.assert_array_equal(model.predict(office.X), expected)
    for columns in ({"q_sol": None}, {"T_za": "q_sol"}):
        model.set_params(columns=columns)
        with pytest.raises(ValueError, match="columns= gives role 'q_sol' of the training table no column of its own"):
            model.predict(office.X)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"outdoor": 0}, "names the role 'outdoor', which is not one of T_oa"),
        ({"T_oa": 2}, "gives 'T_oa' the column 2, but X is an array of 2 columns: give a position"),
        ({"T_oa": "T_oa"}, "the column 'T_oa', but X is an array"),
        ({"T_oa": -1}, "the column -1, but X is an array"),
    ],
)
def test_positions_that_cannot_be(columns, message):
    with pytest.raises(ValueError, match=message):
        read(np.zeros((5, 2)), columns=columns)


@pytest.mark.parametrize("n_jobs", [1, 2])
def test_a_warning_points_at_the_user_through_joblib_and_scikit_learn(office, n_jobs):
    """In a thread of joblib's there is no line of the user; then it is the line that called the package."""
    X = pd.DataFrame(np.zeros((5, 2)), columns=["a", "b"])
    job = delayed(read_table)(BaseEstimator(), X, reset=True, sampling_time="15min")
    with pytest.warns(RoleWarning) as caught:
        Parallel(n_jobs=n_jobs, backend="threading")([job, job])
    files = {w.filename for w in caught if w.category is RoleWarning}
    assert files == {__file__} if n_jobs == 1 else not any("skhybrid" in Path(name).parts for name in files)
    zone = office.X[INPUTS].set_axis(["a", "b", "c", "d"], axis=1).reset_index(drop=True)
    with pytest.warns(RoleWarning) as caught:  # scikit-learn is between
        make_pipeline(FunctionTransformer(), GrayBoxRC(known=BY_POSITION, sampling_time="15min")).fit(
            zone, office.y.to_numpy()
        )
    assert {w.filename for w in caught if w.category is RoleWarning} == {__file__}


def test_frame_without_roles_is_taken_by_position(office):
    X = office.X[INPUTS].set_axis(["a", "b", "c", "d"], axis=1).reset_index(drop=True)
    with pytest.warns(RoleWarning, match="taken by position .'a' as T_oa") as caught:
        model = gray_box(office, X, office.y.to_numpy(), known=BY_POSITION, sampling_time="15min")
    assert {w.filename for w in caught if w.category is RoleWarning} == {__file__}
    np.testing.assert_allclose(model.theta_["Q_3"], -6.0)
    # with time stamps it is a log whose columns nobody has named: refused
    with pytest.raises(ValueError, match="role 'T_oa' is missing: X has 'a'"):
        gray_box(office, X.set_axis(office.X.index), known=BY_POSITION)


def test_a_frame_with_other_roles_than_the_training_array_is_refused(office):
    model = gray_box(office, office.X[INPUTS].to_numpy(), known=BY_POSITION)
    with pytest.raises(ValueError, match="X has no column 'u_2', which the training table has; it has 'T_oa', 'q_sol'"):
        model.predict(office.X[INPUTS].reset_index(drop=True))


def test_columns_that_cannot_be_read():
    with pytest.raises(ValueError, match=r"column 'T_oa' is not numeric .*convert it to float"):
        read(stamped(3).assign(T_oa=["a", "b", "c"]))
    with pytest.raises(ValueError, match="column 'T_oa' appears twice in X"):
        read(pd.concat([stamped(3), stamped(3)], axis=1))
    with pytest.raises(ValueError, match=r"0 feature\(s\)"):
        read(stamped(3)[[]])
    with pytest.raises(ValueError, match="while 4 are required"):
        read(stamped(3), min_rows=4)


def test_numbers_of_any_kind_become_float64():
    X = stamped(3, u_heat=[True, False, True], u_cool=pd.array([1, 0, 1], dtype="Int8"), Q_x=np.float32([1, 2, 3]))
    table = read(X)
    assert {v.dtype for v in table.inputs.values()} == {np.dtype(np.float64)}
    assert all(v.flags.c_contiguous for v in table.inputs.values())
    assert table.order == ("T_oa", "u_heat", "u_cool", "Q_x")
    with pytest.raises(ValueError, match="column 'u_cool' contains NaN in 1 row"):
        read(X.assign(u_cool=pd.array([1, None, 1], dtype="Int8")))


def test_the_callers_table_is_not_written_to(office):
    X, y = office.X.copy(), office.y.copy()
    model = gray_box(office, X, y)
    model.predict(X)
    table = read(X)
    table.history["T_za"][:] = 0.0
    read_target(y, table)[:] = 0.0
    pd.testing.assert_frame_equal(X, office.X)
    pd.testing.assert_series_equal(y, office.y)


def test_a_fitted_model_does_not_change_with_the_callers_table(office):
    X, ahead = office.X[:288].copy(), office.X[288:]
    model = ARXRegressor(alpha=10.0, intervals=False).fit(X, office.y[:288])
    expected = model.predict(ahead)
    X.iloc[:] = 0.0
    np.testing.assert_array_equal(model.predict(ahead), expected)


@pytest.mark.parametrize(
    "model", [ARXRegressor(alpha=10.0, n_lags=4), BoostedRegressor(max_iter=5), DisturbanceForecaster("profile")]
)
def test_a_fitted_model_keeps_no_more_than_the_rows_that_it_needs(office, model):
    rows = clone(model).fit(office.X, office.y)._tail
    assert all(values.base is None for values in (*rows.inputs.values(), *rows.history.values()))


# --------------------------------------------------------------------------------------------------------- bad values
@pytest.mark.parametrize(
    ("values", "found", "remedy"),
    [
        ([np.nan, np.nan], "NaN in 2 rows", "fill short gaps"),
        ([np.inf, -np.inf], "inf in 2 rows", "set it to NaN"),
        ([np.inf, np.nan], "inf in 1 row", "set it to NaN"),
    ],
)
def test_bad_input_names_column_count_and_first_stamp(office, values, found, remedy):
    X = office.X.copy()
    X.iloc[[7, 9], X.columns.get_loc("u_heat")] = values
    with pytest.raises(ValueError, match=f"column 'u_heat' contains {found} .first at 2023-07-08 01:45:00.; {remedy}"):
        gray_box(office, X)
    model = gray_box(office)
    with pytest.raises(ValueError, match=f"column 'u_heat' contains {found}"):
        model.predict(X)
    renamed = X.rename(columns={"u_heat": "burner"})
    with pytest.raises(ValueError, match="column 'burner' contains"):
        gray_box(office, renamed, columns={"u_heat": "burner"})
    with pytest.raises(ValueError, match=f"column 2 contains {found} .first at 7"):
        read(X.to_numpy())


def test_history_may_be_missing_but_not_infinite(office):
    X = office.X.copy()
    X.iloc[5:50, X.columns.get_loc("T_za")] = np.nan
    assert np.isfinite(gray_box(office, X).predict(X)).all()
    X.iloc[60, X.columns.get_loc("T_za")] = np.inf
    with pytest.raises(ValueError, match=r"column 'T_za' contains inf in 1 row .first at 2023-07-08 15:00:00."):
        gray_box(office, X)


def test_target_may_be_missing_up_to_a_share(office):
    y, n = office.y.copy(), len(office.y)
    y.iloc[: n // 2] = np.nan
    assert np.isfinite(gray_box(office, y=y).loss_)
    y.iloc[n // 2] = np.nan
    with pytest.raises(ValueError, match=r"y contains NaN in 50 % of its rows, more than max_missing=0\.5"):
        gray_box(office, y=y)
    assert np.isfinite(gray_box(office, y=y, max_missing=0.6).loss_)
    with pytest.raises(ValueError, match=r"more than max_missing=0\.1"):
        gray_box(office, y=y, max_missing=0.1)


@pytest.mark.parametrize(
    "model",
    [
        GrayBoxRC(n_starts=1),
        PeriodicDisturbanceID(n_starts=1),
        ARXRegressor(),
        DisturbanceForecaster("ridge"),
        SchedulePredictor(),
        TwoStagePredictor(),
    ],
    ids=lambda model: type(model).__name__,
)
def test_a_target_needs_a_measured_value_and_a_share(office, model):
    nothing = office.y * np.nan
    with pytest.raises(ValueError, match=r"^Input y contains NaN in 100 % of its rows; choose a span"):
        clone(model).set_params(max_missing=1.0).fit(office.X, nothing)
    for share in (1.5, "a", None, True):
        with pytest.raises(ValueError, match=rf"^max_missing={share!r} must be a share of the rows, from 0 to 1.$"):
            clone(model).set_params(max_missing=share).fit(office.X, office.y)


def test_parts_accept_what_the_whole_does(office):
    y = office.y.where(np.arange(len(office.y)) % 5 > 2)  # three of five are missing
    parts = {"gray_box": GrayBoxRC(n_starts=1), "forecaster": DisturbanceForecaster("none"), "intervals": False}
    with pytest.raises(ValueError, match=r"NaN in 60 % of its rows, more than max_missing=0.5"):
        TwoStagePredictor(**parts).fit(office.X, y)
    assert np.isfinite(TwoStagePredictor(max_missing=0.7, **parts).fit(office.X, y).predict(office.X)).all()


def test_bad_targets(office):
    y = office.y.copy()
    y.iloc[96] = np.inf
    with pytest.raises(ValueError, match=r"y contains inf in 1 row .first at 2023-07-09 00:00:00.; set it to NaN"):
        gray_box(office, y=y)
    with pytest.raises(ValueError, match="the target y is None"):
        GrayBoxRC().fit(office.X, None)
    with pytest.raises(ValueError, match="X has 384 rows, y 383"):
        gray_box(office, y=office.y.to_numpy()[:-1])
    shifted = office.y.shift(1, freq="15min")
    with pytest.raises(ValueError, match=r"X from 2023-07-08 00:00:00 to .*, y from 2023-07-08 00:15:00 to .*align"):
        gray_box(office, y=shifted)
    with pytest.raises(ValueError, match="Complex data"):
        gray_box(office, y=office.y.to_numpy() + 1j)


# -------------------------------------------------------------------------------------------------------------- units
@pytest.mark.parametrize(
    ("role", "change", "unit"),
    [
        ("T_oa", lambda v: v * 1.8 + 32, "degF rather than degC"),
        ("T_za", lambda v: v * 1.8 + 32, "degF rather than degC"),
        ("T_oa", lambda v: v + 273.15, "K rather than degC"),
        ("q_sol", lambda v: v * 1000, "W/m2 rather than kW/m2"),
        ("u_cool", lambda v: v * 100, "percent rather than a fraction"),
        ("Q_hvac", lambda v: v + 5500.0, "W rather than kW"),
        ("Q_hvac", lambda v: v.where(v.index.hour < 20, 700.0), "W rather than kW"),
    ],
)
def test_likely_units_are_named(office, role, change, unit):
    X = office.X.assign(Q_hvac=0.0)
    X[role] = change(X[role])
    low, high = X[role].min(), X[role].max()
    y = X["T_za"]  # the same quantity
    with pytest.warns(UnitWarning, match=f"column '{role}' .*{unit}") as caught:
        gray_box(office, X, y)
    (warning,) = caught
    assert (f"{low:.4g} to {high:.4g}" if low < high else f"is {low:.4g}") in str(warning.message)
    assert "UnitConverter" in str(warning.message)


@pytest.mark.parametrize("climate", ["oakland", "chicago"])
@pytest.mark.parametrize("start", ["2023-01-07", "2023-07-08"])
def test_right_units_are_silent(climate, start):
    office = make_office(n_days=2, climate=climate, start=start, random_state=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", UnitWarning)
        gray_box(office)
        desert = np.linspace(25.0, 48.0, len(office.X))
        read(office.X.assign(T_oa=desert, u_heat=2.0, Q_hvac=-400.0))  # and a second stage, and a large hall


@pytest.mark.parametrize(
    ("heat", "trained", "told"),
    [
        ([0.0, 900.0], (0.0, 2.0), True),
        ([0.0, -900.0], (-2.0, 0.0), True),
        ([0.0, 24.0], (0.0, 1.0), False),  # a summer before the winter
        ([0.0, 900.0], (0.0, 0.05), False),  # a plant that hardly ran
        ([0.0, 900.0], (0.0, 700.0), False),  # a training in W has been told
        ([0.0, 0.0], None, False),
    ],
)
def test_heat_in_watts_is_known_by_that_of_the_training(heat, trained, told):
    assert is_in_watts(np.array(heat), trained) is told


# --------------------------------------------------------------------------------------------- values that cannot be
SENTINELS = [-9999.0, -999.0, 9.96921e36, -1e300]


@pytest.mark.parametrize("bad", SENTINELS)
@pytest.mark.parametrize("column", ["T_oa", "T_za", "q_sol", "u_heat", "Q_hvac", "T_ground"])
def test_sentinels_are_refused_in_every_role(column, bad):
    X = stamped(400, q_sol=0.2, u_heat=0.5, Q_hvac=1.0, T_ground=10.0, T_za=20.0)
    X.iloc[[6, 8], X.columns.get_loc(column)] = bad
    what = rf"^column '{column}' holds {bad:.4g}".replace("+", r"\+")
    with pytest.raises(ValueError, match=rf"{what}.* in 2 rows .first at 2023-07-08 01:30:00., beyond .*fill value"):
        read(X, reset=False)
    with pytest.raises(ValueError, match=r"column \d holds"):  # by position, where nobody named a role
        read(X[["T_oa", "q_sol", "u_heat"]].assign(q_sol=X[column]).to_numpy())


@pytest.mark.parametrize(
    ("column", "value", "ok"),
    [
        ("T_oa", -89.0, True), ("T_oa", -91.0, False), ("T_oa", 59.0, True), ("T_oa", 61.0, False),
        ("T_za", -29.0, True), ("T_za", -31.0, False), ("T_za", 59.0, True), ("T_za", 61.0, False),
        ("T_supply", 120.0, True), ("T_supply", 230.0, False),
        ("q_sol", -0.04, True), ("q_sol", -0.06, False), ("q_sol_east", 1.59, True), ("q_sol_east", 1.61, False),
        ("u_heat", -0.04, True), ("u_heat", -0.06, False), ("u_heat", 3.0, True), ("u_heat", 11.0, False),
    ],
)  # fmt: skip
def test_physical_ranges_on_both_sides(column, value, ok):
    X = stamped(400, q_sol=0.2, u_heat=0.5, T_za=20.0, T_supply=40.0, q_sol_east=0.1)
    X.iloc[6, X.columns.get_loc(column)] = value
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UnitWarning)
        if ok:
            read(X, reset=False)
        else:
            with pytest.raises(ValueError, match=f"column '{column}' holds {value:g}.* in 1 row"):
                read(X, reset=False)


@pytest.mark.parametrize(("column", "value"), [("T_oa", -65.0), ("T_za", 57.0), ("T_za", -12.0), ("u_heat", 6.0)])
def test_unusual_values_are_warned_of(column, value):
    X = stamped(400, u_heat=0.5, T_za=20.0)
    X.iloc[6, X.columns.get_loc(column)] = value
    with pytest.warns(UnitWarning, match=f"column '{column}'"):
        read(X, reset=False)


def test_few_values_are_no_unit():
    """One row in degF may as well be a failed sensor."""
    X = stamped(400, T_za=20.0)
    with pytest.raises(
        ValueError, match=r"column 'T_za' holds 85 degC in 1 row.*likely degF rather than degC, .*sensor"
    ):
        read(X.assign(T_za=X["T_za"].mask(X.index == X.index[5], 85.0)))
    with pytest.raises(ValueError, match="column 'T_za' holds 72 degC in 1 row"):
        read(X[:1].assign(T_za=72.0), expected_step=QUARTER)


def test_the_target_has_a_range_too(office):
    bad = office.y.mask(office.y.index == office.y.index[9], -9999.0)
    X = office.X.drop(columns="T_za")
    with pytest.raises(ValueError, match=r"^y holds -9999 degC in 1 row .first at 2023-07-08 02:15:00"):
        gray_box(office, X, bad)
    with pytest.raises(ValueError, match=r"^y holds 1e\+200"):
        gray_box(office, X, office.y * 0 + 1e200)
    hourly = make_office(n_days=8, sampling_time="1h", random_state=0)
    with pytest.raises(ValueError, match=r"^y holds .*e\+200 kW"):
        DisturbanceForecaster("ridge").fit(hourly.X, hourly.heat_gain * 1e200)
    with pytest.raises(ValueError, match=r"^y holds -9999"):
        gray_box(office).score(office.X, bad)


@pytest.mark.parametrize("column", ["T_oa", "T_za", "q_sol", "u_heat"])
def test_every_call_refuses_a_sentinel(column, office):
    model = HybridPredictor(known={"Q_h": 6.0}).fit(office.X[:288], office.y[:288])
    good, X = office.X[288:], office.X[288:].copy()
    X.iloc[5, X.columns.get_loc(column)] = -999.0
    calls = {
        "fit": lambda: model.fit(X, good["T_za"]),
        "predict": lambda: model.predict(X),
        "predict_from": lambda: model.predict_from(X, [0]),
        "score": lambda: model.score(X, good["T_za"]),
        "predict_quantiles": lambda: model.predict_quantiles(X, [0.1]),
        "predict_load": lambda: model.predict_load(X, 21.0),
        "drift": lambda: model.drift(X),
        "update": lambda: model.update(X),
        "partial_fit": lambda: model.partial_fit(X, good["T_za"]),
        "forecast, past": lambda: model.forecast(X[:40], good[40:]),
        "simulate": lambda: gray_box(office).simulate(X),
        "transform": lambda: gray_box(office).transform(X),
    }
    if column != "T_za":  # of which nothing is known ahead
        calls["forecast"] = lambda: model.forecast(None, X)
    for call in calls.values():
        with pytest.raises(ValueError, match=rf"column '{column}' holds -999 .*first at 2023-07-11 01:15:00"):
            call()


# ----------------------------------------------------------------------------------------------- T_za in X, and y
def _shuffled(y):
    return np.random.default_rng(0).permutation(y)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda X, y: (X.assign(T_za=X["T_za"] * 1.8 + 32), y), "not the same quantity: .*likely T_za is in degF"),
        (lambda X, y: (X, y * 1.8 + 32), "not the same quantity: .*likely y is in degF"),
        (lambda X, y: (X.assign(T_za=X["T_za"] + 273.15), y), "not the same quantity: .*likely T_za is in K"),
        (lambda X, y: (X, (y - y.mean()) / y.std()), "not the same quantity: .*leave them unscaled"),
        (lambda X, y: (X, _shuffled(y)), "do not move together; give both the same rows in the same order"),
        (lambda X, y: (X[:-1], y.shift(-1)[:-1]), "role 'T_za' of X is y one row earlier"),
        (lambda X, y: (X[1:], y.shift(1)[1:]), "role 'T_za' of X is y one row later"),
    ],
)
@pytest.mark.filterwarnings("ignore::skhybrid.exceptions.UnitWarning")
def test_a_history_that_is_not_y_is_refused(change, message, office):
    X, y = change(office.X, office.y)
    for model in (GrayBoxRC(known=office.theta), ARXRegressor(), SchedulePredictor()):
        with pytest.raises(ValueError, match=message):
            model.fit(X, y)


def test_sensors_that_differ_are_one_quantity(office):
    rng = np.random.default_rng(0)
    other = (office.y + 1.5 + 0.3 * rng.normal(size=len(office.y))).round(0)
    other.iloc[::7] = np.nan
    gray_box(office, office.X.assign(T_za=other))
    gray_box(office, office.X.assign(T_za=np.nan))


@pytest.mark.parametrize("model", [HybridPredictor, ARXRegressor])
@pytest.mark.filterwarnings("ignore::skhybrid.exceptions.UnitWarning")
def test_pipelines_that_lose_the_names_or_scale_are_refused(model, office):
    X, y = office.X, office.y
    for step, by_name in (
        (StandardScaler(), r"column 'q_sol' holds .*scaled values"),
        (SimpleImputer(), None),
    ):
        with pytest.raises(ValueError, match=r"X has no time stamps; .*set_output\(transform='pandas'\)"):
            make_pipeline(step, model()).fit(X, y)
        with pytest.raises(ValueError, match=r"column 4 of X, taken as 'u_4', is y itself.*columns=\{'T_za': 4\}"):
            make_pipeline(step, model(sampling_time="15min")).fit(X, y)
        kept = make_pipeline(clone(step).set_output(transform="pandas"), model())
        if by_name is None:
            kept.fit(X, y)
        else:
            with pytest.raises(ValueError, match=by_name):
                kept.fit(X, y)
    with pytest.raises(ValueError, match=r"role 'T_za' .*leave them unscaled .*no TransformedTargetRegressor"):
        TransformedTargetRegressor(model(), transformer=StandardScaler()).fit(X, y)


def test_a_disturbance_in_another_unit_is_refused():
    hourly = make_office(n_days=8, sampling_time="1h", random_state=0)
    X, y = hourly.X[["T_oa", "q_sol"]], hourly.heat_gain
    DisturbanceForecaster("profile").fit(X.assign(zeta=y), y)
    with pytest.raises(ValueError, match="role 'zeta' of X and y are not the same quantity"):
        DisturbanceForecaster("profile").fit(X.assign(zeta=1000 * y), y)
    with pytest.raises(ValueError, match="role 'zeta' of X and y are not the same quantity"):
        DisturbanceForecaster("profile").fit(X.assign(zeta=y), 1000 * y)
    with pytest.warns(UnitWarning, match=r"y ranges from .* likely W rather than kW"):
        DisturbanceForecaster("profile").fit(X, 1000 * y)


@pytest.mark.parametrize("role", ["T_za", "T_oa"])
def test_zeros_that_fill_a_file_are_told(role, office):
    """A summer never comes near 0 degC, so that 0 is no measurement; in a winter it may be one."""
    filled = office.X[role].where(np.arange(len(office.X)) % 50 != 7, 0.0)
    words = (
        rf"column '{role}' is 0 degC in 8 rows .first at 2023-07-08 01:45:00. and otherwise never below \d.*fill value"
    )
    with pytest.warns(UnitWarning, match=words):
        read(office.X.assign(**{role: filled}))
    with warnings.catch_warnings():
        warnings.simplefilter("error", UnitWarning)
        read(office.X.assign(**{role: filled.where(~np.isin(np.arange(len(filled)), [3, 4]), 1.5)}))
        read(office.X.assign(**{role: 0.0}))


def test_a_single_leap_of_a_room_is_told(office, recwarn):
    X, row = office.X, 100
    for size, told in ((11.0, True), (-15.0, True), (9.0, False)):
        leap = X["T_za"].where(np.arange(len(X)) != row, X["T_za"].iloc[row - 1] + size)
        read(X.assign(T_za=leap))
        if told:
            words = f"column 'T_za' leaps to {leap.iloc[row]:.4g} degC and back at {X.index[row]}, as no room does"
            assert str(recwarn.pop(UnitWarning).message).startswith(words)
        assert len(recwarn) == 0
    read(X.assign(T_za=leap.where(~np.isin(np.arange(len(X)), [row, row + 1]), 45.0)))  # it stays there
    read(X.assign(T_za=X["T_za"].where(np.arange(len(X)) % 20 != 7, 45.0)))  # more than a share of 1 %
    assert len(recwarn) == 0


def test_unmeasured_heat_in_watts_is_told(office, recwarn):
    model = gray_box(office)
    model.simulate(office.X, heat_gain=office.heat_gain)
    assert not [w for w in recwarn if issubclass(w.category, UnitWarning)]
    for watts in (1000 * office.heat_gain, np.full(len(office.X), 300.0)):  # of people, and of a device
        with pytest.warns(UnitWarning, match=r"heat_gain .* likely W rather than kW"):
            model.simulate(office.X, heat_gain=watts)


def test_a_temperature_as_disturbance_is_told(recwarn):
    hourly = make_office(n_days=8, sampling_time="1h", random_state=0)
    DisturbanceForecaster("profile").fit(hourly.X, hourly.heat_gain)
    assert not [w for w in recwarn if issubclass(w.category, UnitWarning)]
    with pytest.warns(UnitWarning, match=r"y is the temperature T_za of X, .* HybridPredictor and ARXRegressor"):
        DisturbanceForecaster("profile").fit(hourly.X, hourly.y)


def test_a_temperature_that_never_changes_is_told(office):
    still = office.y * 0.0 + 21.0
    with pytest.warns(ExcitationWarning, match=rf"y is 21 in all {len(still)} measured rows: is the sensor stuck\?"):
        model = ARXRegressor(intervals=False).fit(office.X.assign(T_za=still), still)
    with warnings.catch_warnings():
        warnings.filterwarnings("error", "y is 21", ExcitationWarning)
        model.score(office.X.assign(T_za=still), still)
        ARXRegressor(intervals=False).fit(office.X[:90].assign(T_za=still), still[:90])  # for less than a day it may


# ------------------------------------------------------------------------------------- values under a mask, and times
def test_masked_values_are_missing(office):
    columns = {"u_heat": 2, "u_cool": 3, "T_za": 4}
    plain, hidden = office.X.to_numpy(), np.zeros(office.X.shape, dtype=bool)
    hidden[50:60, 4] = True
    X = np.ma.masked_array(np.where(hidden, -9999.0, plain), hidden)
    y = np.ma.masked_array(np.where(hidden[:, 4], -9999.0, office.y), hidden[:, 4])
    model = gray_box(office, X, y, columns=columns)
    expected = gray_box(
        office, np.where(hidden, np.nan, plain), np.where(hidden[:, 4], np.nan, office.y), columns=columns
    )
    np.testing.assert_array_equal(model.predict(X), expected.predict(np.where(hidden, np.nan, plain)))
    assert model.score(X, y) == expected.score(X, y)
    hidden[5, 0] = True
    with pytest.raises(ValueError, match=r"column 0 contains NaN in 1 row .first at 5"):
        model.predict(np.ma.masked_array(plain, hidden))


@pytest.mark.parametrize(
    "times",
    [
        lambda i: i,
        lambda i: i.tz_localize("UTC"),
        lambda i: i - i[0],
        lambda i: i.astype(object),
        lambda i: i.to_period("h"),
    ],
)
def test_times_are_no_numbers(times, office):
    with pytest.raises(ValueError, match=r"column 'u_cool' (holds times|is not numeric)"):
        gray_box(office, office.X.assign(u_cool=times(office.X.index)))
    with pytest.raises(ValueError, match=r"^y (holds times|is not numeric)"):
        gray_box(office, y=pd.Series(times(office.X.index), office.X.index))


def test_mappings_and_records_are_refused(office):
    for X in (office.X.to_dict("list"), office.X.to_records(index=False)):
        with pytest.raises(ValueError, match=r"X is a (dict|recarray); give a DataFrame"):
            ARXRegressor(sampling_time="15min").fit(X, office.y)


@pytest.mark.parametrize("kind", ["M8[ns]", "m8[s]"])
def test_arrays_of_times_are_refused(kind):
    with pytest.raises(ValueError, match="X holds times"):
        read(np.arange(20).reshape(10, 2).astype(kind))


def test_targets_of_any_kind_become_float64(office):
    y = office.y.copy()
    y.iloc[:50] = np.nan
    expected = read_target(y, read(office.X))
    for kind in ("string", "Float64", object):
        np.testing.assert_array_equal(read_target(y.astype(kind), read(office.X)), expected)
    for words in (office.y.astype(object).where(office.y > 20, "off"), ["off"] * len(office.y)):
        with pytest.raises(ValueError, match=r"^y is not numeric .could not convert"):
            read_target(words, read(office.X))
    with pytest.raises(ValueError, match=r"^y should be a 1d array, got an array of shape .*, 2\)"):
        read_target(pd.concat([y, y], axis=1), read(office.X))


@pytest.mark.parametrize("kind", [pd.Series, pd.Series.to_frame, pd.Series.to_numpy, pd.Series.tolist])
def test_true_and_false_are_no_temperatures(office, kind):
    """NumPy takes them for 1 and 0."""
    warm = kind(office.y > 22.0)
    with pytest.raises(ValueError, match=r"^y is true or false; give numbers"):
        read_target(warm, read(office.X))
    with pytest.raises(ValueError, match=r"^heat_gain is true or false; give numbers"):
        as_numbers(warm, "heat_gain")


@pytest.mark.parametrize("kind", [bool, "boolean", object])
@pytest.mark.parametrize("role", ["T_oa", "q_sol", "Q_hvac", "T_za", "T_heat_set"])
def test_columns_of_true_and_false_are_stages(office, role, kind):
    on = office.X["u_heat"] > 0.1
    np.testing.assert_array_equal(read(office.X.assign(u_heat=on.astype(kind))).inputs["u_heat"], on)
    with pytest.raises(
        ValueError, match=rf"^column {role!r} is true or false, but {role} is not a stage; give numbers"
    ):
        read(office.X.assign(**{role: on.astype(kind)}))


def test_no_table_is_refused_in_one_sentence(office):
    with pytest.raises(ValueError, match=r"^X is None; give a DataFrame or an array\.$"):
        gray_box(office).predict(None)


def test_a_row_that_is_a_series_is_refused_in_one_sentence(office, recwarn):
    """As ``X.loc[stamp]`` is in a loop; scikit-learn's own message comes with a warning of feature names."""
    model = gray_box(office)
    for call in (model.update, model.predict, lambda X: model.fit(X, office.y)):
        with pytest.raises(ValueError, match=r"^X is a Series; .* one row as X.loc\[\[stamp\]\]"):
            call(office.X.iloc[-1])
    assert not [one for one in recwarn if "feature names" in str(one.message)]


@pytest.mark.parametrize("text", ["21", ["21", "22"], [21.0, "22"], np.array(["21"])])
def test_digits_in_quotes_are_no_numbers(office, text):
    with pytest.raises(ValueError, match=r"^setpoint is text; give numbers"):
        gray_box(office).predict_load(office.X, text)
    with pytest.raises(ValueError, match=r"quantiles=.* must be numbers between 0 and 1"):
        read_quantiles("0.1" if isinstance(text, str) else ["0.1", "0.9"])


# ---------------------------------------------------------------------------------------- rows of X and rows of y
def test_a_target_in_another_order_is_refused(office):
    X, y = office.X.reset_index(drop=True), office.y.reset_index(drop=True)
    for table in (X, office.X):
        with pytest.raises(ValueError, match=r"the rows of y are not in time order: .*y.sort_index"):
            gray_box(office, table, y.sample(frac=1.0, random_state=0), sampling_time="15min")
    with pytest.raises(ValueError, match=r"different indices .X from 10, y from 11.; align them with"):
        gray_box(office, X[10:90], y[11:91], sampling_time="15min")
    gray_box(office, X[10:90], y[10:90].reset_index(drop=True), sampling_time="15min")
    later = office.y[10:90]
    for index in (later.index.to_period("15min"), later.index.astype(str), later.index.astype(object)):
        with pytest.raises(ValueError, match="different indices"):
            gray_box(office, office.X[:80], later.set_axis(index))


# -------------------------------------------------------------------------------------------------------- time stamps
#: zone, a day before the change, and hours of the day of the change
CHANGES = [
    ("Europe/Berlin", "2023-03-25", 23),
    ("Europe/Berlin", "2023-10-28", 25),
    ("America/Chicago", "2023-03-11", 23),
    ("America/Chicago", "2023-11-04", 25),
    ("America/Havana", "2023-03-11", 23),  # midnight itself is left out
    ("America/Havana", "2023-11-04", 25),  # midnight comes twice
]


@pytest.mark.parametrize("start_hour", ["00:00", "10:00"])
@pytest.mark.parametrize(("tz", "day", "length"), CHANGES)
def test_days_begin_at_local_midnight(tz, day, length, start_hour):
    index = pd.date_range(f"{day} {start_hour}", periods=4 * 96, freq="15min", tz=tz)
    table = read(pd.DataFrame({"T_oa": 5.0}, index=index))
    assert table.step == QUARTER
    assert table.step_hours == 0.25
    origins = origin_rows(table.time, "1D", step=table.step)
    dates = pd.Series(index.date)
    np.testing.assert_array_equal(origins, np.flatnonzero(dates != dates.shift()))
    assert np.diff(origins)[1] == 4 * length
    # a naive index of the same wall clock has lost the hour
    with pytest.raises(ValueError, match="localize it if this is daylight saving"):
        read(pd.DataFrame({"T_oa": 5.0}, index=index.tz_localize(None)))


def test_one_instant_in_two_zones_is_one_table(office):
    X = office.X.tz_localize("UTC")
    model = gray_box(office, X, office.y.to_numpy())
    np.testing.assert_allclose(model.simulate(X.tz_convert("Asia/Kolkata")), model.simulate(X))
    gray_box(office, X, office.y.tz_localize("UTC").tz_convert("Asia/Kolkata"))


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        ([0, 1, 1, 2], "has duplicates: 2023-07-08 00:15:00 is followed by 2023-07-08 00:15:00; sort it and drop"),
        ([0, 2, 1, 3], "goes back in time: 2023-07-08 00:30:00 is followed by 2023-07-08 00:15:00"),
        (
            [0, 1, 2, 4, 5],
            "not evenly spaced: 2023-07-08 00:30:00 is followed by 2023-07-08 01:00:00, where most steps are 15",
        ),
    ],
)
def test_disorder_of_time_stamps(office, rows, message):
    with pytest.raises(ValueError, match=message):
        gray_box(office, office.X.iloc[rows], office.y.iloc[rows])
    with pytest.raises(ValueError, match=message):
        gray_box(office).predict(office.X.iloc[rows])


@pytest.mark.parametrize(
    ("draw", "message"),
    [
        (lambda X: train_test_split(X, random_state=0)[0], "the index is shuffled: .*; split rows with .*, never"),
        (lambda X: X.iloc[[*range(96), *range(240, len(X))]], "not evenly spaced: .*, or in cross-validation split"),
        (lambda X: X.iloc[next(KFold(shuffle=True, random_state=0).split(X))[0]], "or in cross-validation split"),
    ],
)
def test_rows_that_were_drawn_for_cross_validation_are_told_a_splitter(office, draw, message):
    """Neither sorting nor an even grid helps there, nor a time zone."""
    X = draw(office.X)
    with pytest.raises(ValueError, match=message):
        ARXRegressor().fit(X, office.y[X.index])


@pytest.mark.parametrize(
    ("index", "message"),
    [
        (lambda i: i.where(np.arange(len(i)) != 5), "NaT at row 5; every row needs a time stamp"),
        (lambda i: i.astype(str), "begins with '2023-07-08 00:00:00', which looks like a time stamp but is not one"),
        (lambda i: i.to_period("15min"), "looks like a time stamp but is not one.*to_timestamp"),
        (lambda i: i - i[0], "looks like a time stamp but is not one"),
        (
            lambda i: pd.Index(np.roll(np.arange(len(i)), 3)),
            "not in time order: index 383 is followed by 0.*never shuffled",
        ),
        (lambda i: pd.Index(np.arange(len(i)) // 2), "not in time order: index 0 is followed by 0"),
        (lambda i: pd.Index(np.arange(len(i))[::-1] / 4), "not in time order"),
        (lambda i: pd.RangeIndex(len(i) + 1).delete(9), "rows are missing: index 8 is followed by 10"),
        (lambda i: pd.Index(np.arange(len(i) + 1) / 4).delete(9), "rows are missing: index 2.0 is followed by 2.5"),
        (
            lambda i: pd.Index(np.sort(np.append(np.arange(len(i) - 1) / 4, 1.1))),
            "rows are not evenly spaced: index 1.0 is followed by 1.1",
        ),
        (lambda i: pd.Index(np.where(np.arange(len(i)) == 5, np.nan, np.arange(len(i)))), "holds NaN at row 5"),
    ],
)
def test_indices_that_are_not_consecutive_time_steps(office, index, message):
    X = office.X.set_axis(index(office.X.index))
    with pytest.raises(ValueError, match=message):
        gray_box(office, X, office.y.to_numpy())


def test_an_index_of_several_levels_is_refused(office):
    X = pd.concat({"A": office.X[:50], "B": office.X[:50]}, names=["zone", "time"])
    with pytest.raises(ValueError, match=r"index has 2 levels .zone, time.; .*one zone at a time"):
        gray_box(office, X, np.tile(office.y[:50], 2))


@pytest.mark.parametrize("model", [GrayBoxRC, ARXRegressor, HybridPredictor, lambda: DisturbanceForecaster("profile")])
def test_tables_without_stamps_need_a_sampling_time(model, office):
    X, y = office.X.reset_index(drop=True), office.y.to_numpy()
    for bare in (X, X.to_numpy()):
        with pytest.raises(ValueError, match=r"X has no time stamps; .*DatetimeIndex.*pass sampling_time="):
            model().fit(bare, y)
    for stamps, remedy in ((office.X.index, r"X\.set"), (office.X.index.astype(str), r"X\.assign.*to_datetime.*\.set")):
        with pytest.raises(ValueError, match=rf"its column 'when' holds them, so give {remedy}_index\('when'\)"):
            model().fit(X.assign(when=stamps), y)
    with pytest.raises(ValueError, match="step of X is unknown, since it has 1 row"):
        read(office.X[:1])


def test_a_forecast_by_the_hour_needs_stamps_as_the_training_had_them(office):
    X, y = office.X, office.y
    for model in (ARXRegressor(), HybridPredictor()):
        model.fit(X[:288], y[:288])
        with pytest.raises(ValueError, match="X has time stamps and the training table has none, or the reverse"):
            model.predict(X[288:].reset_index(drop=True))


ON_ROW_NUMBERS = {
    "gray box": lambda office: PeriodicDisturbanceID(known=office.theta, n_starts=1, horizon="1D"),
    "arx": lambda office: ARXRegressor(),
    "schedule": lambda office: HybridPredictor(network="1R1C", intervals=False),
    "two-stage": lambda office: TwoStagePredictor(
        GrayBoxRC(known=office.theta), DisturbanceForecaster("profile"), intervals=False
    ),
    "forecaster": lambda office: DisturbanceForecaster("profile"),
}


@pytest.mark.filterwarnings("ignore::skhybrid.exceptions.SkhybridWarning")
@pytest.mark.parametrize("name", ON_ROW_NUMBERS)
def test_row_numbers_tell_the_hour_of_the_day(name):
    """Rows 709 on were taken to begin on Monday 00:00 again, at other hours than those that were learned."""
    office = make_office(n_days=9, random_state=0)
    index = pd.date_range(ASSUMED_START, periods=len(office.X), freq="15min")
    y = office.heat_gain if name == "forecaster" else office.y
    X, y = office.X.set_axis(index), y.set_axis(index)
    stamped = ON_ROW_NUMBERS[name](office).fit(X[40:700], y[40:700])
    numbered, target = X.reset_index(drop=True), y.reset_index(drop=True)
    model = ON_ROW_NUMBERS[name](office).set_params(sampling_time="15min").fit(numbered[40:700], target[40:700])
    np.testing.assert_allclose(model.predict(numbered[709:]), stamped.predict(X[709:]), atol=1e-9)
    if hasattr(model, "partial_fit"):
        ahead = [table[720:760].drop(columns="T_za") for table in (X, numbered)]
        expected = stamped.update(X[700:720]).forecast(None, ahead[0])
        model.update(numbered[700:720])
        np.testing.assert_allclose(model.forecast(None, ahead[1]), expected, atol=1e-9)
    wrong = model.predict(numbered[709:].reset_index(drop=True))  # begins another Monday
    assert np.nanmax(np.abs(wrong - model.predict(numbered[709:]))) > 0.1


@pytest.mark.parametrize(
    ("index", "begins"),
    [
        (pd.RangeIndex(5, 9), "2001-01-01 01:15"),
        (pd.Index([700, 701], dtype="uint16"), "2001-01-01 07:00"),  # the second Monday
        (pd.Index([-1, 0, 1]), "2001-01-07 23:45"),
        (pd.RangeIndex(10**15, 10**15 + 2), None),  # no overflow
        (pd.Index([6, 8, 10]), "2001-01-01 00:00"),
        (pd.Index([3.0, 4.0]), "2001-01-01 00:00"),
        (pd.Index([0.08, 0.17, 0.25]), "2001-01-01 00:00"),  # hours, rounded
        (pd.Index(["c", "d"]), "2001-01-01 00:00"),
    ],
)
def test_row_numbers_count_from_monday(index, begins):
    table = read(pd.DataFrame({"T_oa": 5.0}, index), sampling_time="15min")
    assert begins is None or table.time[0] == pd.Timestamp(begins)
    assert (np.diff(table.time) == QUARTER).all()
    week = ASSUMED_START + pd.Timedelta("7D")
    assert ASSUMED_START <= table.time[0] < week


def test_a_backtest_on_row_numbers_begins_its_days_at_midnight(office):
    model = ARXRegressor(sampling_time="15min").fit(office.X[:192].reset_index(drop=True), office.y[:192].to_numpy())
    X, y = office.X.reset_index(drop=True)[200:], office.y.reset_index(drop=True)[200:]
    frame = backtest(model, X, y, horizon="6h", origin_step="1D")
    assert set(frame["origin"]) <= {0, 288 - 200}


@pytest.mark.parametrize("n_rows", [2, 3, 6, 20])
def test_minutes_are_too_few_rows(n_rows, office):
    index = pd.date_range("2023-07-08", periods=n_rows, freq="1min")
    X, y = office.X[:n_rows].set_axis(index), office.y[:n_rows].set_axis(index)
    with pytest.raises(ValueError, match=r"\d+ (rows|row\(s\))"):
        HybridPredictor().fit(X, y)


def test_shuffled_rows_are_refused(office):
    X = office.X.reset_index(drop=True).sample(frac=1.0, random_state=0)
    with pytest.raises(ValueError, match=r"not in time order.*RollingOriginSplit"):
        gray_box(office, X, office.y.to_numpy())


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_stamps_of_any_resolution(unit):
    X = stamped(8)
    assert read(X.set_axis(X.index.as_unit(unit))).step == QUARTER


# ----------------------------------------------------------------------------------------------- another table than fit
def test_other_step_or_columns_than_in_fit(office):
    model = gray_box(office)
    with pytest.raises(ValueError, match="a sampling time of 30 min, but GrayBoxRC was fitted at 15 min; resample"):
        model.predict(office.X[::2])
    with pytest.raises(ValueError, match=r"X has no column 'u_cool', which the training table has; it has 'T_oa'"):
        model.predict(office.X.drop(columns="u_cool"))
    with pytest.raises(ValueError, match="X has 4 features, but GrayBoxRC is expecting 5"):
        gray_box(office, office.X.to_numpy(), columns={"u_heat": 2, "u_cool": 3, "T_za": 4}).predict(np.zeros((3, 4)))


def test_a_single_row_has_the_step_of_fit(office):
    assert gray_box(office).predict(office.X[200:201]).shape == (1,)
    assert read(stamped(1), expected_step=pd.Timedelta("1h")).step == pd.Timedelta("1h")


def test_sampling_time_must_agree_with_the_stamps(office):
    assert gray_box(office, sampling_time="15min").sampling_time_ == QUARTER
    with pytest.raises(ValueError, match="index steps by 15 min, but sampling_time=1 h was given"):
        gray_box(office, sampling_time="1h")
    for odd in ("-15min", "0min"):
        with pytest.raises(ValueError, match=f"sampling_time='{odd}' is not a positive duration"):
            read(np.zeros((4, 2)), sampling_time=odd)
    with pytest.raises(ValueError, match="sampling_time='quarter' is not a duration such as '15min'"):
        read(np.zeros((4, 2)), sampling_time="quarter")


def mended(X, y):
    return X.assign(T_oa=X["T_oa"] + np.sin(np.arange(len(X)))).replace(np.inf, np.nan).fillna(20.0).assign(
        q_sol=0.1
    ), y.replace(np.inf, 20.0)


@pytest.mark.parametrize(
    "call",
    {
        "input": lambda X, y: read(X.drop(columns="T_za").rename(columns={"q_sol": "u_heat"})),
        "history": lambda X, y: read(X),
        "y": lambda X, y: read_target(y, read(mended(X, y)[0])),
        "backtest": lambda X, y: backtest(ARXRegressor().fit(*mended(X, y)), mended(X, y)[0], y),
        "log": lambda X, y: split_log(X.assign(T_za=20.0), Settings()),
        "gap filler": lambda X, y: GapFiller().fit(X),
        "array": lambda X, y: GapFiller(sampling_time="15min").fit(X.to_numpy()),
        "units": lambda X, y: UnitConverter().fit(mended(X, y)[0]).transform(X.astype(object)),
        "facades": lambda X, y: FacadeIrradiance(50.0, 5.0, timezone="UTC").fit(X),
    }.values(),
)
def test_infinite_values_are_refused_in_one_sentence_everywhere(call):
    X = stamped(96, q_sol=0.1, T_za=np.r_[20.0, np.nan, np.full(94, 20.0)])
    y = pd.Series(20.0, X.index)
    X.iloc[[7, 9], 1:], y.iloc[[7, 9]] = np.inf, np.inf
    with pytest.raises(ValueError, match=r"^(column ('[a-zA-Z_]*'|[0-9])|y) contains inf in 2 rows .first at .*; set"):
        call(X, y)


# --------------------------------------------------------------------------------------------------------- durations
def test_rows_of():
    assert rows_of("1D", QUARTER) == 96
    assert rows_of(pd.Timedelta("15min"), QUARTER) == 1
    assert rows_of(np.timedelta64(30, "m"), QUARTER) == 2
    for odd in ("20min", "5min", "-15min", "0min"):
        with pytest.raises(ValueError, match=f"span='{odd}' is not a positive multiple of the sampling time of 15 min"):
            rows_of(odd, QUARTER, "span")
    with pytest.raises(ValueError, match="horizon=24 has no unit; give a duration such as '15min'"):
        rows_of(24, QUARTER)
    with pytest.raises(ValueError, match="horizon='24' has no unit; give a duration such as '15min'"):
        rows_of("24", QUARTER)
    with pytest.raises(ValueError, match="horizon='a day' is not a duration such as"):
        rows_of("a day", QUARTER)


@pytest.mark.parametrize(
    ("name", "call"),
    {
        "max_gap": lambda office: GapFiller(max_gap=3).fit(office.X),
        "max_gap of a log": lambda office: regularize(office.X, max_gap=3),
        "step": lambda office: make_weather(step=5),
        "step of a plan": lambda office: make_prbs(3, scale="1h", step=15),
        "gap": lambda office: list(RollingOriginSplit(train="2D", test="1D", gap=0.5).split(office.X)),
        "sampling_time of a split": lambda office: list(
            RollingOriginSplit(train=8, test=4, sampling_time=15).split(range(99))
        ),
        "sampling_time": lambda office: make_state_space(
            "1R1C", {"C_za": 2.0, "R_zo": 5.0, "A_win": 1.0}, roles=["T_oa", "q_sol"], sampling_time=15
        ),
        "periods": lambda office: frequency_response(gray_box(office), [24]),
        "step of a study": lambda office: Settings(step="15"),
    }.items(),
)
def test_a_duration_without_a_unit_is_refused_everywhere(office, name, call):
    """Pandas reads a number as nanoseconds."""
    said = "is not a duration" if name == "step of a study" else "has no unit; give a duration such as"
    with pytest.raises(ValueError, match=f"^{name.split(' ')[0]} ?=.*{said}"):
        call(office)


def test_rows_covering():
    assert rows_covering("1D", QUARTER) == 96
    assert rows_covering("20min", QUARTER) == 2
    assert rows_covering("1min", QUARTER) == 1
    with pytest.raises(ValueError, match="warmup='0min' is not a positive duration"):
        rows_covering("0min", QUARTER)


def test_origins():
    time = pd.date_range("2023-07-08 21:30", periods=300, freq="15min")
    assert origin_rows(time, None).tolist() == [0]
    assert origin_rows(time, "1D").tolist() == [0, 10, 106, 202, 298]
    assert origin_rows(time, "1D", "6h").tolist() == [0, *range(10, 300, 24)]
    assert origin_rows(time, "12h").tolist() == [0, *range(10, 300, 48)]
    assert origin_rows(time[:1], "1D").tolist() == [0]


# ------------------------------------------------------------------------------------------------- tables joined
def test_table_after_another():
    whole = stamped(20, u_heat=0.5, T_za=np.arange(20.0) + 10, tz="Europe/Berlin", start="2023-10-29 01:00")
    first, second = read(whole[:12]), read(whole[12:].drop(columns="T_za"))
    assert second.follows(first)
    assert not second.follows(None)
    assert not first.follows(second)
    assert not read(whole[13:]).follows(first)
    assert not read(whole.iloc[[12]], expected_step=pd.Timedelta("1h")).follows(first)
    assert not read(whole[["T_oa", "u_heat"]][12:].to_numpy(), columns={"u_heat": 1}).follows(first)
    both = append_tables(first, second)
    assert both.n_history == 12
    assert both.n_rows == 20
    pd.testing.assert_index_equal(both.index, whole.index, exact="equiv")
    np.testing.assert_array_equal(both.inputs["T_oa"], whole["T_oa"])
    np.testing.assert_array_equal(both.measured(), [*whole["T_za"][:12], *[np.nan] * 8])
    assert set(append_tables(first, read(whole[12:].drop(columns="u_heat"))).inputs) == {"T_oa"}
    part = both.rows(slice(12, None))
    pd.testing.assert_index_equal(part.time, second.time, exact="equiv")
    np.testing.assert_array_equal(part.inputs["T_oa"], second.inputs["T_oa"])


def test_concatenated_tables_are_the_whole_again():
    whole = read(stamped(30, u_heat=np.linspace(0, 1, 30), T_za=np.arange(30.0), tz="UTC"))
    parts = [whole.rows(slice(a, b)) for a, b in ((0, 7), (7, 8), (8, 30))]
    for joined, first in ((concatenate_tables(parts), 0), (last_rows(parts, 23), 7), (last_rows(parts, 5), 25)):
        assert joined.n_rows == 30 - first
        assert joined.n_history == 0
        assert (joined.order, joined.step) == (whole.order, whole.step)
        for role in ("T_oa", "u_heat"):
            np.testing.assert_array_equal(joined.inputs[role], whole.inputs[role][first:])
        np.testing.assert_array_equal(joined.measured(), whole.measured()[first:])
        for name in ("index", "time", "utc"):
            pd.testing.assert_index_equal(getattr(joined, name), getattr(whole, name)[first:], exact="equiv")
    assert last_rows(parts, 99).n_rows == 30
    assert last_rows(parts, 0).n_rows == 0
    assert concatenate_tables([read(np.zeros((4, 2))), read(np.ones((3, 2)))]).utc is None


# ------------------------------------------------------------------------------------------- tables that are read once
@pytest.fixture
def parsed(monkeypatch):
    """The tables that are parsed, in a list that grows."""
    seen, parse = [], _table._parse

    def counted(estimator, X, *rest):
        seen.append(X)
        return parse(estimator, X, *rest)

    monkeypatch.setattr(_table, "_parse", counted)
    return seen


def test_roles_of_a_parsed_table_are_selected(parsed):
    whole = read(stamped(6, note=[*"abcdef"], q_sol=0.2, u_heat=0.5, T_x=7.0, T_za=20.0, zeta=np.nan))
    assert len(parsed) == 1
    reader = BaseEstimator()
    found = read_table(reader, whole, required=["T_oa", "q_sol", "T_za"], needed=lambda r: r != "T_x", reset=True)
    assert list(found.inputs) == ["T_oa", "q_sol", "u_heat"]
    assert list(found.history) == ["T_za", "zeta"]
    assert found.inputs["u_heat"] is whole.inputs["u_heat"]
    assert list(reader.feature_names_in_) == ["T_oa", "q_sol", "u_heat", "T_x", "T_za", "zeta"]
    assert reader.n_features_in_ == 6
    other = BaseEstimator()
    assert set(read_table(other, whole, reset=False).inputs) == {"T_oa", "q_sol", "u_heat", "T_x"}
    assert not hasattr(other, "feature_names_in_")
    # as in a frame, a role can be left out on purpose, and the irradiance of a facade stands for the sun
    left = read(whole, columns={"T_za": None, "q_sol": None}, required=["q_sol", "T_za"])
    assert (set(left.inputs), set(left.history)) == ({"T_oa", "u_heat", "T_x"}, {"zeta"})
    facade = read(read(stamped(4, q_sol_south=0.1)), required=["T_oa", "q_sol"])
    assert list(facade.inputs) == ["T_oa", "q_sol_south"]
    assert len(parsed) == 2


def test_parsed_tables_that_are_refused():
    table = read(stamped(6, u_heat=0.5, T_za=20.0))
    reader = BaseEstimator()
    for settings, message in [
        ({"required": ["T_oa", "q_sol"]}, "role 'q_sol' is missing: the table has 'T_oa', 'u_heat', 'T_za'"),
        ({"min_rows": 7}, r"the table has 6 row\(s\), but at least 7 are required"),
        ({"expected_step": pd.Timedelta("1h")}, "a sampling time of 15 min, but BaseEstimator was fitted at 1 h"),
    ]:
        with pytest.raises(ValueError, match=message):
            read_table(reader, table, reset=False, **settings)
    X = stamped(80)
    gappy = read(X.drop(X.index[30:50]), gaps=True)
    assert gappy.breaks == (0, 30)
    with pytest.raises(ValueError, match="gap: 2023-07-08 07:15:00 is followed by 2023-07-08 12:30:00; give one"):
        read_table(reader, gappy, reset=True)
    assert not hasattr(reader, "feature_names_in_")
    assert read(gappy, gaps=True).breaks == (0, 30)
    hole = read(stamped(6, T_za=[20, 20, np.nan, 20, 20, 20]))
    with pytest.raises(ValueError, match=r"column 'T_za' contains NaN in 1 row .first at 2023-07-08 00:30:00"):
        read(hole, history_roles=("zeta",))


@pytest.mark.parametrize("adapt", [None, "refit"])
def test_a_public_call_parses_its_table_once(office, parsed, adapt):
    train, later = slice(0, 288), slice(288, None)
    model = ARXRegressor(adapt=adapt, horizon="6h")
    X, y = office.X[later], office.y[later]
    for call in (
        lambda: model.fit(office.X[train], office.y[train]),
        lambda: model.predict(X),
        lambda: model.predict_from(X, [0, 30]),
        lambda: model.predict_quantiles(X),
        lambda: model.predict_quantiles_from(X, [0, 30]),
        lambda: model.score(X, y),
    ):
        parsed.clear()
        call()
        assert len(parsed) == 1
    again = ARXRegressor(adapt=adapt, horizon="6h")
    table = read(office.X[train])
    parsed.clear()
    np.testing.assert_array_equal(again.fit(table, office.y[train]).coef_, model.coef_)
    np.testing.assert_array_equal(again.predict(read(X)), model.predict(X))
    assert len(parsed) == 2  # of X, here and by the other model


# ------------------------------------------------------------------------------------------ nothing half-fitted is left
class Steps(BaseEstimator):
    """Sets an attribute, fails if it is told so, and sets another one."""

    def __init__(self, error=None):
        self.error = error

    @unchanged_on_failure
    def fit(self, value):
        self.first_ = [value]
        if value > 1:
            self.only_later_ = value
        if self.error is not None:
            raise self.error
        self.last_ = value
        return self


@pytest.mark.parametrize("error", [ValueError("no"), KeyboardInterrupt(), SystemExit(1)])
def test_a_method_that_fails_changes_nothing(error):
    fresh = Steps(error)
    with pytest.raises(type(error)):
        fresh.fit(1)
    assert vars(fresh) == {"error": error}
    model = Steps().fit(1)
    first = model.first_
    model.error = error
    with pytest.raises(type(error)) as caught:
        model.fit(2)
    assert caught.value is error
    assert vars(model) == {"error": error, "first_": [1], "last_": 1}
    assert model.first_ is first
    model.error = None
    assert (model.fit(3).first_, model.only_later_, model.last_) == ([3], 3, 3)


@pytest.mark.parametrize("unit", ["s", "ns"])
def test_joined_stamps_are_those_of_pandas(unit):
    """Also where zones on other clocks have been joined before, over a change of the clock and with another name."""
    start = pd.date_range("2024-03-30 20:00", periods=40, freq="30min", unit=unit)
    clocks = [start, start.tz_localize("UTC"), start.tz_localize("UTC").tz_convert("Europe/Berlin")]
    for index in [*clocks, start.rename("time"), *clocks]:
        utc = index.tz_localize("UTC") if index.tz is None else index.tz_convert("UTC")
        whole = Stamps(index, index.tz_localize(None), utc)
        parts = [Stamps(*(stamps[rows] for stamps in whole)) for rows in (slice(7), slice(7, 8), slice(8, None))]
        found = joined_stamps(parts)
        for one, expected in zip(found, whole, strict=True):
            assert one.equals(expected)
            assert (one.dtype, one.name) == (expected.dtype, expected.name)
        assert joined_stamps(parts).time is found.time, "zones on one clock share them"
    numbers = [Stamps(pd.RangeIndex(k, k + 2), start[k : k + 2], None) for k in (0, 2)]
    assert list(joined_stamps(numbers).shown) == [0, 1, 2, 3]


def test_joined_stamps_have_the_zone_of_the_last_table():
    """Whichever zones the same instants were joined in before."""
    utc = pd.date_range("2024-03-30 20:00", periods=40, freq="30min", tz="UTC")
    berlin = utc.tz_convert("Europe/Berlin")
    local = berlin.tz_localize(None)
    for index in (utc, berlin, utc):
        joined = joined_stamps([Stamps(berlin[:8], local[:8], utc[:8]), Stamps(index[8:], local[8:], utc[8:])])
        assert joined.shown.equals(index)
        assert joined.shown.dtype == index.dtype


def test_joined_stamps_have_the_clock_of_their_own_zone():
    """Also where another zone, which has the same hours at both ends and others between, was joined before."""
    utc = pd.date_range("2024-01-01", "2024-12-31", freq="1h", tz="UTC")
    for zone in ("America/Denver", "America/Phoenix"):
        local = utc.tz_convert(zone).tz_localize(None)
        parts = [Stamps(utc[rows], local[rows], utc[rows]) for rows in (slice(24), slice(24, None))]
        assert joined_stamps(parts).time.equals(local)


def test_results_kept_for_stamps_are_of_these_stamps_and_arguments():
    """Whatever stamps and holidays came before, also at the address of others; and nobody can change a kept one."""
    holiday = Holidays(dates=("2024-01-03",))
    for day in range(200):  # the stamps of most days are gone, and their place is taken by others
        stamps = pd.date_range("2024-01-01", periods=24, freq="1h") + pd.Timedelta(day, "D")
        plain, special = NO_HOLIDAYS.day_of_week(stamps), holiday.day_of_week(stamps)
        assert (plain == stamps.dayofweek).all()
        assert (special == (6 if day == 2 else stamps.dayofweek)).all()
        assert (hour_of_day(stamps) == np.arange(24)).all()
        table = ZoneTable({}, {}, stamps, stamps, None, pd.Timedelta("1h"))
        assert table.rows(slice(2, 5)).time.equals(stamps[2:5])
        assert table.rows(slice(3, None)).index.equals(stamps[3:])
    with pytest.raises(ValueError, match="read-only"):
        plain[0] = 5
