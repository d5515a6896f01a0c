"""Transformers of ``skhybrid.preprocessing``: scikit-learn's checks, index and names, units, gaps."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import parametrize_with_checks

from skhybrid.hybrid.parts import preprocessed
from skhybrid.preprocessing import FacadeIrradiance, GapFiller, UnitConverter


@parametrize_with_checks(
    [
        UnitConverter(),
        UnitConverter({0: "degF"}),
        GapFiller(sampling_time="15min"),
        GapFiller(max_gap="30min", sampling_time="15min"),
    ]
)
def test_scikit_learn_checks(estimator, check):
    check(estimator)


@pytest.fixture
def log():
    index = pd.date_range("2024-03-30 22:00", periods=12, freq="15min", tz="Europe/Amsterdam")
    return pd.DataFrame(
        {
            "T_oa": np.linspace(32.0, 54.0, 12),
            "q_sol": np.linspace(0.0, 800.0, 12),
            "u_heat": np.linspace(0.0, 100.0, 12),
            "T_za": np.linspace(68.0, 69.0, 12),
        },
        index=index,
    )


UNITS = {"T_oa": "degF", "q_sol": "W/m2", "u_heat": "percent", "T_za": "degF"}


@pytest.mark.parametrize("output", ["default", "pandas"])
@pytest.mark.parametrize("transformer", [UnitConverter(UNITS), GapFiller()])
def test_frames_keep_index_names_and_order(log, transformer, output):
    fitted = clone(transformer).set_output(transform=output).fit(log)
    out = fitted.transform(log)
    assert isinstance(out, pd.DataFrame)
    pd.testing.assert_index_equal(out.index, log.index)
    assert list(out.columns) == list(log.columns) == list(fitted.get_feature_names_out())
    assert (out.dtypes == np.float64).all()


def test_units_against_known_values(log):
    before = log.copy()
    out = UnitConverter(UNITS).fit_transform(log)
    pd.testing.assert_frame_equal(log, before)  # the input is left as it was
    assert out["T_oa"].iloc[0] == pytest.approx(0.0)
    assert out["T_za"].iloc[0] == pytest.approx(20.0)
    assert out["q_sol"].iloc[-1] == pytest.approx(0.8)
    assert out["u_heat"].iloc[-1] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("unit", "value", "expected"),
    [
        ("K", 273.15, 0.0),
        ("degF", -40.0, -40.0),
        ("W", 1500.0, 1.5),
        ("Btu/h", 3412.142, 1.0),
        ("kBtu/h", 3.412142, 1.0),
        ("MW", 0.002, 2.0),
        ("tons", 1.0, 3.51685),
        ("%", 55.0, 0.55),
        ("Btu/(h ft2)", 317.0, 1.0),
        ("kW", 2.0, 2.0),
    ],
)
def test_every_unit(unit, value, expected):
    frame = pd.DataFrame({"sensor": [value]})
    converter = UnitConverter({"sensor": unit}).fit(frame)
    assert converter.transform(frame)["sensor"].iloc[0] == pytest.approx(expected, abs=2e-4)
    back = converter.inverse_transform(converter.transform(frame))
    assert back["sensor"].iloc[0] == pytest.approx(value)


def test_units_of_an_array_by_role_or_position():
    X = np.array([[50.0, 500.0, 30.0]])
    expected = [[10.0, 0.5, 0.3]]
    np.testing.assert_allclose(UnitConverter({"T_oa": "degF", "q_sol": "W/m2", "u_2": "%"}).fit_transform(X), expected)
    np.testing.assert_allclose(UnitConverter({0: "degF", 1: "W/m2", 2: "%"}).fit_transform(X), expected)


def test_missing_history_passes_the_unit_converter(log):
    log.iloc[3, 3] = np.nan
    out = UnitConverter(UNITS).fit_transform(log)
    assert out["T_za"].isna().tolist() == log["T_za"].isna().tolist()


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ({"T_oa": "degf"}, "did you mean 'degF'"),
        ({"T_oa": "furlong"}, "not one of degC"),
        ({"q_sol": "degF"}, r"'q_sol' the unit 'degF', but that role needs a unit of irradiance, such as 'kW/m2'"),
        ({"outdoor": "degF"}, "column 'outdoor', but X has 'T_oa'"),
        ({9: "degF"}, "column 9"),
    ],
)
def test_refused_units(log, units, message):
    with pytest.raises(ValueError, match=message):
        UnitConverter(units).fit(log)


def test_text_in_a_converted_column_is_named(log):
    with pytest.raises(ValueError, match="column 'T_oa' is not numeric"):
        UnitConverter(UNITS).fit_transform(log.astype({"T_oa": str}).replace({"T_oa": {"32.0": "off"}}))


def test_short_gaps_are_filled_by_lines_and_long_ones_left(log):
    truth = log.copy()
    log.iloc[2:4, 0] = np.nan  # half an hour
    log.iloc[5:10, 1] = np.nan  # an hour and a quarter
    out = GapFiller(max_gap="1h").fit_transform(log)
    np.testing.assert_allclose(out["T_oa"], truth["T_oa"])  # the truth is a line
    assert out["q_sol"].isna().sum() == 5
    assert GapFiller(max_gap="75min").fit_transform(log)["q_sol"].notna().all()
    assert GapFiller(max_gap="15min").fit_transform(log)["T_oa"].isna().sum() == 2
    for kind in ("object", "category"):
        np.testing.assert_allclose(GapFiller().fit_transform(log.astype({"T_oa": kind}))["T_oa"], truth["T_oa"])


@pytest.mark.parametrize("column", ["T_heat_set", "T_cool_set_north"])
def test_short_gaps_of_set_points_hold_the_last_value(log, column):
    """No set-point between the two was ever in force."""
    log[column] = np.where(np.arange(len(log)) < 6, 17.0, 21.0)
    gap = log.copy()
    gap.iloc[4:6, -1] = np.nan
    pd.testing.assert_frame_equal(GapFiller().fit_transform(gap), log)


@pytest.mark.parametrize("column", ["T_za", "T_za_north", "zeta"])
def test_history_is_never_filled(log, column):
    log[column] = 1.0
    log.iloc[4, list(log.columns).index(column)] = np.nan
    assert GapFiller().fit_transform(log)[column].isna().sum() == 1
    step, measured = GapFiller().fit(log), [column]
    pd.testing.assert_frame_equal(preprocessed(step, log, measured), log)
    ahead = log.drop(columns=column)
    pd.testing.assert_frame_equal(preprocessed(step, ahead, measured), ahead)
    pd.testing.assert_frame_equal(preprocessed(SimpleNamespace(transform=lambda X: 2 * X), ahead, measured), 2 * ahead)


def test_history_and_set_points_of_other_names_are_told_by_columns(log):
    """A line through a gap of the measured temperature reads what comes after it."""
    columns = {"T_za": "indoor", "T_heat_set": "wanted", "zeta": None}
    log = log.rename(columns={"T_za": "indoor"}).assign(wanted=np.where(np.arange(12) < 6, 17.0, 21.0))
    gap = log.copy()
    gap.iloc[5] = np.nan
    found = GapFiller(columns=columns).fit_transform(gap)
    np.testing.assert_array_equal(found.isna().sum(), [0, 0, 0, 1, 0])
    assert found["wanted"].iloc[5] == 17.0
    of_array = GapFiller(sampling_time="15min", columns={"T_za": 3, "T_heat_set": 4}).fit_transform(gap.to_numpy())
    np.testing.assert_array_equal(of_array, found)


def test_a_column_that_is_not_there_is_named(log):
    with pytest.raises(ValueError, match="columns= gives 'T_za' the column 'indoor', but X has 'T_oa', 'q_sol'"):
        GapFiller(columns={"T_za": "indoor"}).fit(log)
    with pytest.raises(ValueError, match="columns= names the role 'indoor'"):
        GapFiller(columns={"indoor": "T_za"}).fit(log)


def test_gaps_at_the_ends_stay(log):
    log.iloc[[0, -1], 0] = np.nan
    assert GapFiller().fit_transform(log)["T_oa"].isna().tolist() == [True] + [False] * 10 + [True]


def test_absent_rows_make_a_gap_long(log):
    thinned = log.drop(log.index[3:9])
    thinned.iloc[3, 0] = np.nan  # after six absent rows
    assert GapFiller(max_gap="1h").fit_transform(thinned)["T_oa"].isna().sum() == 1


def test_stamps_out_of_order_are_refused(log):
    """Interpolation between them would give wrong values without a word."""
    log.iloc[4, 0] = np.nan
    for rows in (slice(None, None, -1), [0, 1, 2, 4, 3, *range(5, 12)]):
        with pytest.raises(ValueError, match=r"time stamps are not in order: row .* has 2024-03-3"):
            GapFiller().fit_transform(log.iloc[rows])
    log.index = log.index.where(np.arange(12) != 3, pd.NaT)
    with pytest.raises(ValueError, match="row 3 has NaT"):
        GapFiller().fit_transform(log)


def test_units_that_are_none_are_refused(log):
    with pytest.raises(ValueError, match=r"units=\['degF'\] must be a mapping of columns to units"):
        UnitConverter(["degF"]).fit(log)
    with pytest.raises(ValueError, match=r"gives 'T_oa' the unit \['degF'\], which is not one of"):
        UnitConverter({"T_oa": ["degF"]}).fit(log)


def test_a_column_with_two_units_is_refused(log):
    with pytest.raises(ValueError, match="names the column 'T_oa' twice"):
        UnitConverter({"T_oa": "degF", 0: "K"}).fit(log)


def test_gaps_of_an_array_go_by_sampling_time():
    X = np.array([[0.0], [np.nan], [np.nan], [3.0]])
    assert np.isnan(GapFiller(max_gap="1h", sampling_time="1h").fit_transform(X)).sum() == 2
    np.testing.assert_allclose(GapFiller(max_gap="2h", sampling_time="1h").fit_transform(X).ravel(), [0, 1, 2, 3])


def test_text_columns_pass_the_gap_filler(log):
    log["note"] = "ok"
    assert (GapFiller().fit_transform(log)["note"] == "ok").all()


@pytest.mark.parametrize("max_gap", ["soon", "-1h", 3, "3", pd.NaT])
def test_refused_max_gap(log, max_gap):
    with pytest.raises(ValueError, match="max_gap="):
        GapFiller(max_gap=max_gap).fit(log)


def test_in_a_pipeline_with_pandas_output(log):
    log.iloc[2, 0] = np.nan
    pipeline = make_pipeline(UnitConverter(UNITS), GapFiller()).set_output(transform="pandas")
    out = pipeline.fit_transform(log)
    assert out.index.equals(log.index)
    assert out["T_oa"].iloc[2] == pytest.approx((out["T_oa"].iloc[1] + out["T_oa"].iloc[3]) / 2)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda X: pd.concat([X, X], axis=1), "column 'T_oa' appears twice in X"),
        (lambda X: X[[]], r"0 feature\(s\)"),
        (lambda X: X[:0], r"0 sample\(s\)"),
        (lambda X: X.assign(T_oa=X.index), r"column 'T_oa' holds times \(datetime64"),
        (lambda X: X.assign(T_oa=X.index - X.index[0]), r"column 'T_oa' holds times \(timedelta64"),
    ],
)
def test_tables_that_are_refused(change, message, log):
    for transformer in (UnitConverter({"T_oa": "degF"}), FacadeIrradiance(40.0, 0.0, columns={"q_sol": "T_oa"})):
        with pytest.raises(ValueError, match=message):
            transformer.fit_transform(change(log))


def test_masked_values_are_missing():
    X = np.ma.masked_values([[0.0], [-9999.0], [2.0]], -9999.0)
    np.testing.assert_allclose(GapFiller(sampling_time="15min").fit_transform(X), [[0.0], [1.0], [2.0]])
    assert np.isnan(UnitConverter({"T_oa": "degF"}).fit_transform(X)).tolist() == [[False], [True], [False]]


def test_an_array_needs_a_sampling_time(log):
    for X in (log.to_numpy(), log.reset_index(drop=True)):
        with pytest.raises(ValueError, match=r"X has no time stamps; .*sampling_time="):
            GapFiller().fit_transform(X)
    with pytest.raises(ValueError, match=r"its column 'when' holds them, so give X.set_index\('when'\)"):
        GapFiller().fit_transform(log.reset_index(names="when"))
