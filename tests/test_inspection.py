"""Displays draw what they were given, with labels, units and a legend."""

from __future__ import annotations

from io import StringIO

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure
from sklearn.base import BaseEstimator
from sklearn.exceptions import NotFittedError

from skhybrid import ARXRegressor, GrayBoxRC
from skhybrid.hybrid.building.zone_columns import ZoneColumns
from skhybrid.inspection import (
    BodeDisplay,
    DayAheadDisplay,
    DisturbanceWeekDisplay,
    ForecastDisplay,
    LeadErrorDisplay,
    PosteriorDisplay,
    ProfileDisplay,
    ResidualDisplay,
    RobustnessDisplay,
    RoomMapDisplay,
    ScheduleDisplay,
    StepResponseDisplay,
)
from skhybrid.inspection._style import time_axis
from skhybrid.inspection.unshown_figure import blank_axes
from skhybrid.inspection.zone_panels import weeks_and_days_figure, weeks_figure
from skhybrid.model_selection import backtest

pytestmark = pytest.mark.usefixtures("closed_figures")

INDEX = pd.date_range("2024-01-01", periods=6 * 24, freq="1h", tz="Europe/Amsterdam")


class Shifted(BaseEstimator):
    """A forecaster that is wrong by 0.1 K an hour ahead."""

    def __sklearn_is_fitted__(self):
        return True

    def fit(self, X, y):
        return self

    def predict_from(self, X, origins, horizon=None):
        leads = np.arange(1, 25)
        return X["T_za"].to_numpy()[np.asarray(origins)[:, None] + leads] + 0.1 * leads


@pytest.fixture
def table():
    warm = 20 + np.sin(np.arange(len(INDEX)))
    return pd.DataFrame({"T_oa": 5.0, "T_za": warm}, index=INDEX)


@pytest.fixture
def frame(table):
    return backtest(Shifted(), table, table["T_za"])


def _lines(ax):
    return {line.get_label(): line for line in ax.get_lines() if not line.get_label().startswith("_")}


def _legend(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


# ---------------------------------------------------------------------------------------------------------- forecasts
def test_a_forecast_is_drawn_beside_the_measurement(frame):
    display = ForecastDisplay.from_predictions({"hybrid": frame, "ARX": frame})
    assert display.figure_ is display.ax_.figure
    assert display.ax_.get_ylabel() == "zone temperature [degC]"
    assert "Europe/Amsterdam" in display.ax_.get_xlabel()
    assert _legend(display.ax_) == ["measured", "hybrid", "ARX"]
    lines = _lines(display.ax_)
    np.testing.assert_array_equal(lines["measured"].get_ydata(), frame["y_true"])
    np.testing.assert_array_equal(lines["hybrid"].get_ydata(), frame["y_pred"])
    assert lines["hybrid"].get_color() != lines["ARX"].get_color()


def _edges(band):
    """Lowest and highest drawn value of a shaded band."""
    return band.get_paths()[0].vertices[:, 1].min(), band.get_paths()[0].vertices[:, 1].max()


def test_quantiles_are_shaded_and_named(frame):
    wide = frame.assign(**{"q_0.1": 5.0, "q_0.25": 15.0, "q_0.5": 20.0, "q_0.75": 25.0, "q_0.9": 35.0})
    ax = ForecastDisplay.from_predictions(wide).ax_
    assert _legend(ax) == ["measured", "forecast", "80 % interval", "50 % interval"]
    assert [_edges(band) for band in ax.collections] == [(5.0, 35.0), (15.0, 25.0)]
    both = ForecastDisplay.from_predictions({"hybrid": wide, "ARX": frame}).ax_
    assert _legend(both) == ["measured", "hybrid", "hybrid, 80 %", "hybrid, 50 %", "ARX"]


def test_the_next_day_shows_its_interval():
    forecast = pd.DataFrame({"T_za": 20.0, "zeta": 0.1, "q_0.05": 18.0, "q_0.95": 23.0}, index=INDEX[:24])
    with_weather = forecast.assign(q_sol=0.2, q_sol_east=0.1)
    ax = DayAheadDisplay.from_predictions(with_weather, setpoint=21.0).ax_
    assert _legend(ax) == ["forecast", "90 % interval", "set-point"]
    assert _edges(ax.collections[0]) == (18.0, 23.0)


def test_only_the_chosen_span_is_drawn(frame):
    ax = ForecastDisplay.from_predictions(frame, start="2024-01-03", end="2024-01-04").ax_
    assert len(_lines(ax)["measured"].get_ydata()) == 25
    with pytest.raises(ValueError, match="no forecast lies between"):
        ForecastDisplay.from_predictions(frame, start="2025-01-01")


def test_overlapping_origins_are_not_drawn_on_one_another(table):
    often = backtest(Shifted(), table, table["T_za"], origin_step="6h")
    drawn = _lines(ForecastDisplay.from_predictions(often).ax_)["forecast"].get_xdata()
    assert len(drawn) == len(set(drawn))


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"start": 5}, "start=5 is a number, but the back-test has time stamps; give one, such as '2024-01-01 01:00"),
        ({"end": "noon"}, "end='noon' is not a time stamp; give one, such as '2024-01-01 01:00"),
    ],
)
def test_a_limit_that_is_no_stamp_says_why(frame, limits, said):
    with pytest.raises(ValueError) as error:
        ForecastDisplay.from_predictions(frame, **limits)
    assert said in str(error.value)


def test_a_limit_with_a_time_zone_needs_a_back_test_with_one(frame):
    bare = frame.assign(origin=frame["origin"].dt.tz_localize(None), time=frame["time"].dt.tz_localize(None))
    with pytest.raises(ValueError, match="has a time zone, but the back-test has none"):
        ForecastDisplay.from_predictions(bare, start=INDEX[30])


def test_no_line_crosses_the_time_between_forecasts(table):
    short = backtest(Shifted(), table, table["T_za"]).query("lead <= '6h'")
    lines = _lines(ForecastDisplay.from_predictions(short.assign(**{"q_0.1": 18.0, "q_0.9": 23.0})).ax_)
    for label, column in (("measured", "y_true"), ("forecast", "y_pred")):
        drawn = lines[label].get_ydata()
        np.testing.assert_array_equal(np.flatnonzero(np.isnan(drawn)), [6, 13, 20, 27])  # once after each span
        np.testing.assert_array_equal(drawn[~np.isnan(drawn)], short[column])


def test_back_tests_of_different_days_are_all_in_view(table):
    early, late = (backtest(Shifted(), table[rows], table["T_za"][rows]) for rows in (slice(49), slice(72, None)))
    ax = ForecastDisplay.from_predictions({"early": early, "late": late}).ax_
    lines = _lines(ax)
    assert ax.get_xlim() == (lines["early"].get_xdata(orig=False)[0], lines["late"].get_xdata(orig=False)[-1])
    drawn = lines["measured"].get_ydata()
    np.testing.assert_array_equal(drawn[~np.isnan(drawn)], [*early["y_true"], *late["y_true"]])


def test_forecast_and_measurement_of_different_clocks_are_not_drawn_together(frame):
    bare = frame.assign(origin=frame["origin"].dt.tz_localize(None), time=frame["time"].dt.tz_localize(None))
    with pytest.raises(ValueError, match="'a', 'b' have different clocks: 'Europe/Amsterdam', 'no time zone'"):
        ForecastDisplay.from_predictions({"a": frame, "b": bare})
    day = pd.DataFrame({"T_za": 20.0}, index=INDEX[:24])
    with pytest.raises(ValueError, match=r"measured has another clock \(no time zone\) than the forecast \(Europe"):
        DayAheadDisplay.from_predictions(day, measured=day.tz_localize(None))
    DayAheadDisplay.from_predictions(day, measured=day.tz_convert("UTC"))  # the same instants


def test_a_display_is_made_from_an_estimator(table, frame):
    by_estimator = ForecastDisplay.from_estimator(Shifted(), table, table["T_za"])
    pd.testing.assert_frame_equal(by_estimator.frames["Shifted"], frame)
    several = LeadErrorDisplay.from_estimator({"a": Shifted(), "b": Shifted()}, table, table["T_za"])
    assert list(several.errors) == ["a", "b"]


class TwoRooms(Shifted):
    """A building of which one room is forecast 0.5 K too warm, the other is not measured."""

    zones_ = ("study", "hall")
    _columns = ZoneColumns(zones_, {})

    def predict_from(self, X, origins, horizon=None):
        return np.full((len(origins), 24, 2), (18.0, 20.5))

    def predict_quantiles_from(self, X, origins, quantiles, horizon):
        return self.predict_from(X, origins, horizon)[..., None] + np.subtract(quantiles, 0.5)


def test_each_zone_of_a_building_has_a_panel(table):
    y = pd.DataFrame({"T_za_hall": 20.0, "T_za_study": np.nan}, index=table.index)
    display = ForecastDisplay.from_estimator(TwoRooms(), table, y, quantiles=(0.1, 0.9), title="house")
    assert [ax.get_ylabel() for ax in display.ax_] == ["study [degC]", "hall [degC]"]
    study, hall = (_lines(ax) for ax in display.ax_)
    assert set(hall["measured"].get_ydata()) == {20.0}
    assert set(hall["TwoRooms"].get_ydata()) == {20.5}
    assert list(study) == ["TwoRooms"]
    np.testing.assert_allclose(_edges(display.ax_[0].collections[0]), (17.6, 18.4))
    assert [t.get_text() for t in display.figure_.legends[0].get_texts()] == ["TwoRooms", "80 % interval", "measured"]
    both = {"house": display.frames["TwoRooms"], "other": display.frames["TwoRooms"]}
    assert list(_lines(ForecastDisplay.from_predictions(both).ax_[0])) == ["house", "other"]
    with pytest.raises(ValueError, match="ax has 1 axes, but this display needs 2"):
        display.plot(plt.gca())


def test_a_display_can_be_drawn_again_on_given_axes(frame):
    _, ax = plt.subplots()
    display = ForecastDisplay.from_predictions(frame, ax=ax)
    assert display.ax_ is ax
    assert display.plot().ax_ is not ax
    with pytest.raises(ValueError, match="ax has 1 axes, but this display needs 2"):
        DayAheadDisplay(pd.DataFrame({"T_za": [1.0], "Q_hvac": [1.0]}, index=INDEX[:1])).plot(ax)
    with pytest.raises(ValueError, match="no back-test to draw"):
        ForecastDisplay.from_predictions({})


# -------------------------------------------------------------------------------------------------------- error by lead
def test_the_error_is_drawn_by_lead(frame):
    ax = LeadErrorDisplay.from_predictions({"hybrid": frame}).ax_
    line = _lines(ax)["hybrid"]
    np.testing.assert_allclose(line.get_xdata(), np.arange(1, 25))
    np.testing.assert_allclose(line.get_ydata(), 0.1 * np.arange(1, 25))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("lead [h]", "RMSE of temperature [K]")


# -------------------------------------------------------------------------------------------------- weekly disturbance
def test_the_week_is_by_local_hours():
    index = pd.date_range("2024-03-18", periods=4 * 7 * 24, freq="1h", tz="Europe/Amsterdam")  # the clock changes
    office = np.where((index.day_of_week < 5) & (index.hour >= 8) & (index.hour < 18), 3.0, 0.0)
    display = DisturbanceWeekDisplay.from_predictions(pd.Series(office, index=index), truth=office + 1)
    week = display.week
    assert set(week.index[week["median"] == 3.0]) == {24 * day + hour for day in range(5) for hour in range(8, 18)}
    np.testing.assert_allclose(week["truth"], week["median"] + 1)
    assert display.ax_.get_ylabel() == "unmeasured heat [kW]"
    assert _legend(display.ax_) == ["10 to 90 % of the weeks", "median estimate", "truth (mean)"]


@pytest.mark.parametrize("n_zones", [1, 2, 3])
def test_the_weeks_have_a_panel_per_zone(n_zones):
    time = pd.date_range("2024-01-01", periods=24, freq="1h")
    known = {"origin": time[0], "lead": time - time[0], "time": time, "y_true": 20.0, "y_pred": 20.5}
    frame = pd.concat([pd.DataFrame({"zone": f"zone {number}", **known}) for number in range(n_zones)])
    figure = weeks_figure({"hybrid": frame}, pd.Timedelta("2D"))
    assert [ax.get_ylabel() for ax in figure.axes if ax.axison] == [f"zone {n} [degC]" for n in range(n_zones)]


@pytest.mark.parametrize("columns", [["T_za"], ["T_za", "Q_hvac"]])
def test_a_row_per_zone_has_its_week_and_its_day(columns):
    time = pd.date_range("2024-01-01", periods=24, freq="1h")
    known = {"origin": time[0], "lead": time - time[0], "time": time, "y_true": 20.0, "y_pred": 20.5}
    frame = pd.concat([pd.DataFrame({"zone": zone, **known}) for zone in ("hall", "attic")])
    day = pd.DataFrame({"T_za": 21.0, "Q_hvac": 2.0}, index=time + pd.Timedelta("1D"))[columns]
    forecasts = {"hall": day, "attic": day[["T_za"]]}
    figure = weeks_and_days_figure({"hybrid": frame}, forecasts, pd.Timedelta("2D"), power="relative")
    found = [ax.get_ylabel() for ax in figure.axes if ax.axison]
    of_load = ["hall [relative]"] * (len(columns) - 1)
    assert found == ["hall [degC]", "hall [degC]", *of_load, "attic [degC]", "attic [degC]"]
    assert [ax.get_title(loc="right") for ax in figure.axes][:2] == ["back-test", "the next day"]
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()][:3] == ["measured", "hybrid", "forecast"]


def test_the_week_is_drawn_where_the_training_table_had_no_temperature(table):
    rows = table.assign(T_oa=5.0 + np.cos(np.arange(len(table)) / 9.0), q_sol=0.0, u_heat=np.arange(len(table)) % 2)
    model = GrayBoxRC("1R1C", known={"Q_h": 6.0}, n_starts=1, random_state=0).fit(
        rows.drop(columns="T_za"), rows["T_za"]
    )
    drawn = DisturbanceWeekDisplay.from_estimator(model, rows).week["median"]
    assert drawn.notna().any()


def test_hours_of_the_week_that_were_never_seen_stay_empty():
    for step in ("15min", "3h"):
        index = pd.date_range("2024-01-01", "2024-01-02 23:59", freq=step)  # a Monday and a Tuesday
        week = DisturbanceWeekDisplay.from_predictions(pd.Series(1.0, index=index)).week
        assert (week["median"].iloc[:49] == 1.0).all()
        assert week["median"].iloc[49:].isna().all()


def test_the_week_of_an_estimator_reads_its_gray_box(table):
    class GrayBox:
        feature_names_in_ = np.array(["T_za", "T_oa"], dtype=object)

        def estimate_disturbance(self, X, kind, smooth):
            assert list(X.columns) == ["T_za", "T_oa"]
            return pd.Series(2.0 if kind == "output" else 1.0, index=X.index)

    class Hybrid:
        gray_box_ = GrayBox()

    class Scheduled:
        gray_box_ = type("Network", (), {"schedule_": None})()

    with pytest.raises(ValueError, match="Scheduled learned schedules and estimates no disturbance; draw a Schedule"):
        DisturbanceWeekDisplay.from_estimator(Scheduled(), table)
    display = DisturbanceWeekDisplay.from_estimator(Hybrid(), table, kind="output")
    assert display.ax_.get_ylabel() == "temperature disturbance [K]"
    assert display.week["median"].dropna().eq(2.0).all()
    with pytest.raises(ValueError, match="truth has the shape"):
        DisturbanceWeekDisplay.from_predictions(pd.Series(1.0, index=INDEX), truth=[1.0])
    with pytest.raises(ValueError, match="truth has other time stamps than the disturbance"):
        DisturbanceWeekDisplay.from_predictions(table["T_oa"], truth=table["T_za"][::-1])
    with pytest.raises(ValueError, match="no time stamps"):
        DisturbanceWeekDisplay.from_predictions(pd.Series(1.0, index=range(96)))


def test_displays_are_drawn_into_a_part_of_a_figure(table):
    left, right = plt.figure(layout="constrained", figsize=(12, 4)).subfigures(1, 2)
    y = pd.DataFrame({"T_za_hall": 20.0, "T_za_study": 21.0}, index=table.index)
    whole = ForecastDisplay.from_estimator(TwoRooms(), table, y, quantiles=(0.1, 0.9), ax=left.subplots(2))
    assert len(left.legends) == 1
    assert whole.figure_ is left
    RoomMapDisplay.from_predictions({("a", "b"): 80.0}, {"a": 0.2, "b": 0.3}, ax=right.subplots())
    left.figure.canvas.draw()


# --------------------------------------------------------------------------------------------------------- the next day
@pytest.mark.parametrize("load", [True, False])
def test_the_next_day_has_temperature_and_load(load):
    forecast = pd.DataFrame({"T_za": 20.0, "Q_hvac": -1.0}, index=INDEX[:24])
    forecast = forecast if load else forecast[["T_za"]]
    display = DayAheadDisplay.from_predictions(forecast, measured=forecast + 0.5, setpoint=21.0)
    above = np.ravel(display.ax_)[0]
    assert display.n_axes == len(np.ravel(display.ax_)) == (2 if load else 1)
    assert _legend(above) == ["measured", "forecast", "set-point"]
    if load:
        assert _legend(display.ax_[1]) == ["delivered", "needed (forecast)"]
        assert "[kW]" in display.ax_[1].get_ylabel()


def test_blank_axes_leave_no_figure_with_pyplot():
    figure, axes = blank_axes(2, (4, 3))
    assert isinstance(figure, Figure)
    assert len(axes) == 2
    assert plt.get_fignums() == []


def test_schedules_are_drawn_by_hour_and_type_of_day():
    index = pd.MultiIndex.from_product([("weekday", "weekend"), range(24)], names=["day", "hour"])
    schedule = pd.DataFrame({"gain": np.arange(48.0), "ua": -np.arange(48.0)}, index=index)
    display = ScheduleDisplay.from_predictions(schedule, title="learned")
    above, below = display.ax_
    weekend = _lines(above)["weekend"]
    np.testing.assert_array_equal(weekend.get_ydata()[:24], np.arange(24.0, 48.0))
    np.testing.assert_array_equal(weekend.get_xdata(), np.arange(25))
    assert weekend.get_drawstyle() == "steps-post"
    np.testing.assert_array_equal(_lines(below)["weekday"].get_ydata()[:24], -np.arange(24.0))
    assert "kW]" in above.get_ylabel()
    assert "kW/K" in below.get_ylabel()


@pytest.mark.parametrize(
    ("display", "given", "words"),
    [
        (DisturbanceWeekDisplay, 1, "ARXRegressor is not an identification, such as OutputDisturbanceID; give one"),
        (ResidualDisplay, 1, "ARXRegressor is not an identification, such as OutputDisturbanceID; give one"),
        (ProfileDisplay, 3, "ARXRegressor is not an identification, such as OutputDisturbanceID; give one"),
        (RoomMapDisplay, 0, "ARXRegressor is not a BuildingPredictor; give one"),
        (PosteriorDisplay, 0, "ARXRegressor is not a PatternExpressiveness; give one"),
        (RobustnessDisplay, 0, "ARXRegressor is not a RobustnessComparison; give one"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_an_estimator_of_another_kind_is_refused(display, given, words, table):
    rows = table.assign(T_oa=5.0 + np.cos(np.arange(len(table)) / 9.0))
    model = ARXRegressor().fit(rows, rows["T_za"])
    with pytest.raises(ValueError, match=words):
        display.from_estimator(model, *(rows, rows["T_za"], "R_zo")[:given])
    with pytest.raises(NotFittedError):
        display.from_estimator(ARXRegressor(), *(rows, rows["T_za"], "R_zo")[:given])


@pytest.mark.parametrize(
    ("display", "words"),
    [
        (ForecastDisplay, "the back-test has no column 'y_true'"),
        (LeadErrorDisplay, "the back-test has no column 'y_true'"),
        (DayAheadDisplay, "the forecast has no column 'T_za'"),
        (ScheduleDisplay, "the schedule has no column 'gain'"),
        (DisturbanceWeekDisplay, "zeta is a DataFrame; give the Series of estimate_disturbance"),
        (BodeDisplay, "the frame 'model' is not such a response; give the DataFrame of .*frequency_response"),
        (StepResponseDisplay, "the frame 'model' is not such a response; give the DataFrame of .*step_response"),
        (ProfileDisplay, "profile is a DataFrame; give the ProfileLikelihood of .*profile_likelihood"),
        (ResidualDisplay, "diagnostics is a DataFrame; give the Diagnostics of .*diagnose"),
        (RobustnessDisplay, "difference has no column 'q_0.05'"),
        (RoomMapDisplay, "couplings is a DataFrame; give the Mapping of pairs"),
    ],
)
def test_a_frame_of_another_kind_is_refused(display, words, table):
    n = {RobustnessDisplay: 4, RoomMapDisplay: 2}.get(display, 1)
    with pytest.raises(ValueError, match=words):
        display.from_predictions(*[table[["T_oa"]]] * n)


@pytest.mark.parametrize(
    ("display", "given", "words"),
    [
        (ForecastDisplay, None, "frames is a NoneType; give the DataFrame of skhybrid.model_selection.backtest"),
        (ForecastDisplay, {"a": 1}, r"frames\['a'\] is a int"),
        (ForecastDisplay, pd.DataFrame({"y_true": [1.0], "y_pred": [1.0]}), "has no column 'origin'"),
        (StepResponseDisplay, [1, 2], "responses is a list"),
        (StepResponseDisplay, pd.DataFrame(), "'model' is not such a response"),
        (BodeDisplay, pd.DataFrame({"T_oa": [1.0]}, pd.to_timedelta(["1h"])), "'model' is not such a response"),
        (PosteriorDisplay, pd.DataFrame(), "draws has no rows or no columns"),
    ],
)
def test_what_is_no_frame_of_a_display_is_refused(display, given, words):
    with pytest.raises(ValueError, match=words):
        display.from_predictions(given)


def test_parts_of_a_comparison_and_of_a_map_must_fit():
    quantiles = [f"q_{level}" for level in (0.05, 0.25, 0.5, 0.75, 0.95)]
    difference = pd.DataFrame(0.0, index=["a"], columns=quantiles)
    values = pd.Series([0.1, 0.2], index=["a", "b"])
    for given, words in (((values, difference), "difference has no case 'b'"), (([1], difference), "errors is a list")):
        with pytest.raises(ValueError, match=words):
            RobustnessDisplay.from_predictions(*given, values, ["a"])
    with pytest.raises(ValueError, match="couplings name 'hall', which is not a pair of zones"):
        RoomMapDisplay.from_predictions({"hall": 1.0}, {"hall": 0.3})


@pytest.mark.parametrize(
    ("couplings", "errors", "words"),
    [
        ({}, {}, "errors name no zone"),
        ({("a", "a"): 1.0}, {"a": 0.3}, "couplings join 'a' with itself"),
        ({("a", "b"): "x"}, {"a": 0.3, "b": 0.2}, r"couplings give \('a', 'b'\) the value 'x'"),
        ({("a", "b"): -3.0}, {"a": 0.3, "b": 0.2}, r"couplings give \('a', 'b'\) the value -3.0"),
        ({("a", "b"): None}, {"a": 0.3, "b": np.inf}, "errors give 'b' the value inf"),
    ],
)
def test_a_map_of_what_cannot_be_is_refused(couplings, errors, words):
    with pytest.raises(ValueError, match=words):
        RoomMapDisplay.from_predictions(couplings, errors)


def test_a_back_test_whose_times_are_no_times_is_refused(frame):
    """Read from a CSV, it was drawn with a tick for each row; leads in hours counted as nanoseconds."""
    read = pd.read_csv(StringIO(frame.to_csv(index=False)))
    with pytest.raises(
        ValueError, match=r"column 'origin' of the back-test holds text; convert it with pd.to_datetime"
    ):
        ForecastDisplay.from_predictions(read)
    assert LeadErrorDisplay.from_predictions(read).ax_.get_xlim()[1] == 24.0
    with pytest.raises(ValueError, match=r"column 'lead' of the back-test holds numbers; convert it with pd.to_timed"):
        LeadErrorDisplay.from_predictions(frame.assign(lead=frame["lead"] / pd.Timedelta("1h")))


def test_back_tests_of_other_zones_are_not_drawn_together(frame):
    for others in (
        {"a": frame.assign(zone="x"), "b": frame},
        {"a": frame.assign(zone="x"), "b": frame.assign(zone="y")},
    ):
        with pytest.raises(ValueError, match="the back-tests 'a', 'b' are not of the same zones"):
            ForecastDisplay.from_predictions(others)


def test_axes_that_are_none_are_refused(frame):
    for wrong in (3, plt.figure()):
        with pytest.raises(ValueError, match=f"ax is a {type(wrong).__name__}; give axes"):
            ForecastDisplay.from_predictions(frame, ax=wrong)


def test_a_day_without_rows_or_with_a_load_in_words_is_refused():
    day = pd.DataFrame({"T_za": 20.0}, index=INDEX[:24])
    with pytest.raises(ValueError, match="the forecast has no rows"):
        DayAheadDisplay.from_predictions(day[:0])
    with pytest.raises(ValueError, match="column 'Q_hvac' of the forecast is not numeric"):
        DayAheadDisplay.from_predictions(day.assign(Q_hvac="much"))


def test_one_edge_is_no_interval():
    day = pd.DataFrame({"T_za": 20.0, "Q_hvac": 1.0, "Q_hvac_0.1": 0.5}, index=INDEX[:24])
    load = DayAheadDisplay.from_predictions(day).ax_[1]
    assert "80 % interval" not in [text.get_text() for text in load.get_legend().get_texts()]


def test_draws_that_are_all_equal_are_drawn():
    ax = PosteriorDisplay.from_predictions(pd.DataFrame({"time": np.zeros(50), "ID": np.linspace(-1.0, 1.0, 50)})).ax_
    assert [label.get_text() for label in ax.get_yticklabels()] == ["time", "ID"]


def test_draws_without_a_value_are_refused():
    with pytest.raises(ValueError, match="draws holds NaN"):
        PosteriorDisplay.from_predictions(pd.DataFrame({"time": [0.1, np.nan, 0.2]}))


def test_an_error_that_is_missing_leaves_the_others_of_its_case():
    errors = pd.Series([0.1, np.nan, 0.3, 0.2], index=["a", "a", "a", "b"])
    quantiles = pd.DataFrame(0.0, index=["a", "b"], columns=["q_0.05", "q_0.25", "q_0.5", "q_0.75", "q_0.95"])
    compared = errors, quantiles, pd.Series([0.5, 0.9], index=["a", "b"]), ["a"]
    left = RobustnessDisplay.from_predictions(*compared).ax_[0]
    assert left.patches[0].get_path().get_extents().bounds[2] == pytest.approx(0.1)  # quartiles of 0.1 and 0.3
    with pytest.raises(ValueError, match="n_cases=0 must be an integer of at least 1"):
        RobustnessDisplay.from_predictions(*compared, n_cases=0)


@pytest.mark.parametrize(
    ("setpoint", "said"),
    [
        ("21", "setpoint is text; give numbers"),
        ((21.0, 24.0), "setpoint has the shape"),
        (pd.Series(21.0, index=range(24)), "setpoint has no time of the forecast"),
        (pd.Series(21.0, index=INDEX[:24].tz_localize(None)), "setpoint has no time of the forecast"),
    ],
)
def test_a_setpoint_of_other_rows_is_refused(setpoint, said):
    with pytest.raises(ValueError, match=said):
        DayAheadDisplay.from_predictions(pd.DataFrame({"T_za": 20.0}, index=INDEX[:24]), setpoint=setpoint)


def test_schedules_of_a_model_that_has_none_are_refused():
    with pytest.raises(ValueError, match="Shifted has learned no schedules"):
        ScheduleDisplay.from_estimator(Shifted())


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("hours", [3, 24, 47, 49, 71, 73, 168, 500])
@pytest.mark.parametrize("width", [4.4, 9.0])
def test_a_time_axis_of_any_length_has_ticks_and_no_warning(width, hours):
    figure, (ax,) = blank_axes(1, (width, 2.0))
    time_axis(ax, pd.date_range("2024-01-01", periods=4 * hours + 1, freq="15min", tz="Europe/Amsterdam"))
    figure.draw_without_rendering()
    assert 2 <= len(ax.get_xticks()) <= 10
