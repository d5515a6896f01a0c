"""``FacadeIrradiance``: against pvlib by hand, symmetry of the sun's day, energy, night, time zones, pipelines."""

import re
import warnings

import numpy as np
import pandas as pd
import pvlib
import pytest
from sklearn.base import clone
from sklearn.pipeline import make_pipeline
from sklearn.utils.estimator_checks import parametrize_with_checks

from skhybrid import GrayBoxRC, persistence
from skhybrid.datasets import load_small_office
from skhybrid.exceptions import SkhybridWarning
from skhybrid.preprocessing import FacadeIrradiance, UnitConverter
from skhybrid.study import log_split

FACADES = list(log_split.FACADES)  # a study knows them by name
CHICAGO = {"latitude": 41.98, "longitude": -87.92}
ROWS_ARE_TIME_STEPS = "without time stamps, the position of the sun follows from the position of the row in the table"


def _expected(estimator):
    return {
        "check_methods_sample_order_invariance": ROWS_ARE_TIME_STEPS,
        "check_methods_subset_invariance": ROWS_ARE_TIME_STEPS,
    }


@parametrize_with_checks(
    [
        FacadeIrradiance(**CHICAGO, start="2024-06-01", timezone="UTC", sampling_time="15min"),
        FacadeIrradiance(
            **CHICAGO, facades={"roof_edge": 10.0}, dhi=0, start="2024-06-01 06:00-06:00", sampling_time="1h"
        ),
    ],
    expected_failed_checks=_expected,
)
def test_scikit_learn_checks(estimator, check):
    check(estimator)


def _sky(start="2024-03-18", days=4, step="15min", tz="Etc/GMT+6"):
    """Clear-sky global, direct and diffuse irradiance [kW/m2] at the middle of each step."""
    index = pd.date_range(start, periods=int(days * pd.Timedelta("1D") / pd.Timedelta(step)), freq=step, tz=tz)
    place = pvlib.location.Location(CHICAGO["latitude"], CHICAGO["longitude"])
    clear = place.get_clearsky(index + pd.Timedelta(step) / 2, model="haurwitz")["ghi"].to_numpy() / 1000.0
    return pd.DataFrame({"T_oa": 10.0, "q_sol": clear}, index=index)


@pytest.fixture
def sky():
    return _sky()


def _by_hand(stamp, ghi, azimuth, dni=None, dhi=None, glazing=True, albedo=0.2):
    """One plane at one stamp, by pvlib's own transposition, in W/m2."""
    stamps = pd.DatetimeIndex([stamp])
    sun = pvlib.solarposition.get_solarposition(stamps, CHICAGO["latitude"], CHICAGO["longitude"], method="nrel_numpy")
    zenith, sun_azimuth = sun["zenith"].iloc[0], sun["azimuth"].iloc[0]
    if dni is None:
        parts = pvlib.irradiance.erbs(ghi, zenith, stamps[0].day_of_year)
        dni, dhi = float(parts["dni"]), float(parts["dhi"])
    total = pvlib.irradiance.get_total_irradiance(90, azimuth, zenith, sun_azimuth, dni, ghi, dhi, albedo=albedo)
    if not glazing:
        return float(total["poa_global"])
    diffuse = pvlib.iam.marion_diffuse("physical", 90.0)
    direct = total["poa_direct"] * pvlib.iam.physical(pvlib.irradiance.aoi(90, azimuth, zenith, sun_azimuth))
    return float(direct + total["poa_sky_diffuse"] * diffuse["sky"] + total["poa_ground_diffuse"] * diffuse["ground"])


@pytest.mark.parametrize("glazing", [True, False])
@pytest.mark.parametrize("step", ["15min", "1h"])
def test_against_pvlib_by_hand(step, glazing):
    sky = _sky(step=step)
    out = FacadeIrradiance(**CHICAGO, glazing=glazing).fit_transform(sky)
    for stamp in ("2024-03-19 08:00-06:00", "2024-03-19 12:00-06:00", "2024-03-20 16:00-06:00"):
        middle = pd.Timestamp(stamp) + pd.Timedelta(step) / 2
        for name, azimuth in (("east", 90), ("south", 180), ("west", 270), ("north", 0)):
            expected = _by_hand(middle, 1000 * sky["q_sol"][stamp], azimuth, glazing=glazing) / 1000
            assert out[f"q_sol_{name}"][stamp] == pytest.approx(expected, abs=5e-4), (stamp, name)


def test_logged_direct_and_diffuse_are_used_instead_of_a_model(sky):
    noon = pd.Timestamp("2024-03-19 12:00-06:00")
    logged = sky.assign(dni=0.4, dhi=0.3)
    out = FacadeIrradiance(**CHICAGO, dni="dni", dhi="dhi").fit_transform(logged)
    expected = _by_hand(noon + pd.Timedelta("7.5min"), 1000 * sky["q_sol"][noon], 180, dni=400.0, dhi=300.0)
    assert out["q_sol_south"][noon] == pytest.approx(expected / 1000, abs=5e-4)
    assert list(out.columns) == ["T_oa", "q_sol", *FACADES]


@pytest.mark.parametrize("given", ["dni", "dhi"])
def test_what_is_not_logged_follows_from_the_balance(given):
    """With ghi = dni cos(zenith) + dhi, one of dni and dhi says as much as both, but for a sun below 3 degrees."""
    index = pd.date_range("2024-06-20", periods=96, freq="15min", tz="Etc/GMT+6")
    middle = index + pd.Timedelta("7.5min")
    sun = pvlib.solarposition.get_solarposition(middle, CHICAGO["latitude"], CHICAGO["longitude"], method="ephemeris")
    height = np.cos(np.radians(sun["zenith"].to_numpy())).clip(0)
    dni, dhi = 0.7 * (height > 0), 0.12 * (height > 0)
    log = pd.DataFrame({"q_sol": dni * height + dhi, "dni": dni, "dhi": dhi}, index=index)
    both = FacadeIrradiance(**CHICAGO, dni="dni", dhi="dhi").fit_transform(log)
    one = FacadeIrradiance(**CHICAGO, **{given: given}).fit_transform(log.drop(columns={"dni", "dhi"} - {given}))
    rows = height > np.sin(np.radians(3.1))
    assert rows.sum() > 50
    np.testing.assert_allclose(one[FACADES][rows], both[FACADES][rows], atol=1e-12)


def test_global_irradiance_alone_comes_near_to_what_all_three_say():
    """Four months of EnergyPlus weather, which has direct and diffuse: the figures that the user guide quotes."""
    office = load_small_office("irregular")
    log = office.X[["q_sol"]].join(office.frame[["dni", "dhi"]])
    logged = FacadeIrradiance(**CHICAGO, dni="dni", dhi="dhi").fit_transform(log)[FACADES]
    modelled = FacadeIrradiance(**CHICAGO).fit_transform(log[["q_sol"]])[FACADES]
    day = log["q_sol"] > 0
    rms = np.sqrt(((modelled - logged)[day] ** 2).mean())
    np.testing.assert_allclose(rms, [0.028, 0.033, 0.043, 0.014], atol=0.002)
    np.testing.assert_allclose(logged[day].mean(), [0.157, 0.232, 0.144, 0.088], atol=0.002)


def test_east_in_the_morning_is_west_in_the_afternoon():
    """About solar noon at a solstice (the sun's declination stands still), under a sky that is symmetric too."""
    place = {"latitude": 45.0, "longitude": 0.0}
    index = pd.date_range("2024-06-20 00:00", periods=96, freq="15min", tz="UTC")
    middle = index + pd.Timedelta("7.5min")
    transit = pvlib.solarposition.sun_rise_set_transit_spa(index[:1], 45.0, 0.0)["transit"].iloc[0]
    offset = ((middle - transit) / pd.Timedelta("1h")).to_numpy()
    ghi = 0.9 * np.cos(np.pi * offset / 16).clip(0)
    out = FacadeIrradiance(**place).fit_transform(pd.DataFrame({"q_sol": ghi}, index=index))
    hours = np.arange(-6.0, 6.0, 0.5)
    east = np.interp(hours, offset, out["q_sol_east"])
    west = np.interp(-hours, offset, out["q_sol_west"])
    assert east.max() > 0.4
    np.testing.assert_allclose(east, west, atol=0.02)
    south = np.interp(hours, offset, out["q_sol_south"])
    np.testing.assert_allclose(south, np.interp(-hours, offset, out["q_sol_south"]), atol=0.01)


def test_energy_is_bounded_also_at_a_low_sun_with_a_faulty_log():
    """No plane gets more than the sun above the atmosphere, half the sky and half of what the ground reflects."""
    rng = np.random.default_rng(0)
    index = pd.date_range("2024-01-01", periods=365 * 24, freq="1h", tz="UTC")
    # noise all night, dawns brighter than can be: sensors do that
    log = pd.DataFrame({"q_sol": rng.uniform(-0.01, 0.6, len(index))}, index=index)
    out = FacadeIrradiance(**CHICAGO).fit_transform(log)
    bound = 1.42 + 0.6 * log["q_sol"].clip(0)
    assert (out[FACADES].to_numpy() >= 0).all()
    assert (out[FACADES].to_numpy() <= bound.to_numpy()[:, None]).all()
    sun = pvlib.solarposition.get_solarposition(index + pd.Timedelta("30min"), **CHICAGO, method="ephemeris")
    low = sun["zenith"].to_numpy() > 87.0
    assert low.sum() > 3000
    # with a sun that low all light is diffuse: at most half the sky and a tenth of the total from the ground
    assert (out.loc[low, FACADES].max(axis=1) <= 0.6 * log["q_sol"].clip(0)[low] + 1e-12).all()


def test_nights_are_dark_and_never_missing(sky):
    out = FacadeIrradiance(**CHICAGO).fit_transform(sky)
    assert out.notna().all(axis=None)
    assert (out.loc[sky["q_sol"] == 0, FACADES] == 0).all(axis=None)
    # a cloudless March day: the south side gets most, the north side only scattered light
    total = out[FACADES].sum()
    assert total["q_sol_south"] > 1.3 * total["q_sol_east"] > 2.6 * total["q_sol_north"]


@pytest.mark.parametrize("place", [CHICAGO | {"longitude": 87.92}, CHICAGO | {"timezone": "Asia/Tokyo"}])
def test_light_while_the_sun_is_far_below_the_horizon_is_told(place):
    """With the sign of the longitude forgotten, all facades got the same light in silence."""
    office = load_small_office().X["2018-12-01":"2018-12-07"]
    with pytest.warns(SkhybridWarning, match=r"% of the irradiance was logged while the sun at latitude .* time zone"):
        FacadeIrradiance(**place).fit_transform(office.tz_localize(None) if "timezone" in place else office)
    with warnings.catch_warnings():
        warnings.simplefilter("error", SkhybridWarning)
        for offset in (0.0, 0.01):  # of a sensor, at night too
            FacadeIrradiance(**CHICAGO).fit_transform(office.assign(q_sol=office["q_sol"] + offset))
            FacadeIrradiance(**CHICAGO).fit_transform(office.resample("3h").mean())


def test_missing_light_stays_missing_in_its_row_only(sky):
    sky.iloc[[40, 41], 1] = np.nan
    out = FacadeIrradiance(**CHICAGO).fit_transform(sky)
    np.testing.assert_array_equal(np.flatnonzero(out["q_sol_south"].isna()), [40, 41])


def test_stamps_in_any_zone_and_naive_ones_with_a_zone_agree(sky):
    facades = FacadeIrradiance(**CHICAGO).fit_transform(sky)[FACADES].to_numpy()
    abroad = sky.tz_convert("Europe/Amsterdam")
    np.testing.assert_allclose(FacadeIrradiance(**CHICAGO).fit_transform(abroad)[FACADES], facades, atol=1e-12)
    naive = sky.tz_localize(None)
    for zone in ("Etc/GMT+6", "-06:00"):
        out = FacadeIrradiance(**CHICAGO, timezone=zone).fit_transform(naive)
        np.testing.assert_allclose(out[FACADES], facades, atol=1e-12)
        pd.testing.assert_index_equal(out.index, naive.index)
    array = FacadeIrradiance(**CHICAGO, start=sky.index[0], sampling_time="15min").fit_transform(sky.to_numpy())
    np.testing.assert_allclose(array[:, 2:], facades, atol=1e-12)


def test_later_rows_without_stamps_go_on_from_the_start(sky):
    """They began at the start again, under the sun of another hour."""
    rows, facades = sky.reset_index(drop=True), FacadeIrradiance(**CHICAGO, start=sky.index[0], sampling_time="15min")
    whole = facades.fit_transform(rows)
    pd.testing.assert_frame_equal(facades.fit(rows[:96]).transform(rows[150:]), whole[150:])
    pd.testing.assert_frame_equal(clone(facades).fit_transform(rows[50:150]), whole[50:150])


@pytest.mark.parametrize(
    ("settings", "change", "message"),
    [
        ({}, lambda X: X.tz_localize(None), "no time zone"),
        ({"timezone": "Mars/Base"}, lambda X: X.tz_localize(None), "Mars/Base"),
        ({"timezone": "America/Chicago"}, lambda X: X.tz_localize(None).shift(-8, "D"), "daylight saving"),
        ({}, lambda X: X.reset_index(drop=True), "start="),
        ({}, lambda X: X.to_numpy(), "start="),
        ({}, lambda X: X.rename(columns={"q_sol": "ghi"}), "expects q_sol in a column 'q_sol'"),
        ({"dni": "dni"}, lambda X: X, "expects dni in a column 'dni'"),
        ({"latitude": 141.98}, lambda X: X, "latitude=141.98"),
        ({"longitude": None}, lambda X: X, "longitude=None"),
        ({"longitude": True}, lambda X: X, "longitude=True must be a number of degrees from -180 to 180"),
        ({"albedo": 20}, lambda X: X, "albedo=20"),
        ({"glazing": "no"}, lambda X: X, "glazing='no' must be True or False"),
        ({"columns": ["q_sol"]}, lambda X: X, "columns=.* must be a mapping of 'q_sol' to a column"),
        ({"start": "noon", "sampling_time": "1h"}, lambda X: X.to_numpy(), "start='noon' is not a time stamp"),
        ({"albedo": None}, lambda X: X, "albedo=None must be a number"),
        ({"facades": {"a": np.nan}}, lambda X: X, "gives 'a' the azimuth nan"),
        ({"facades": {"a": "south"}}, lambda X: X, "gives 'a' the azimuth 'south'"),
        ({"facades": ["south"]}, lambda X: X, "must be a mapping"),
        ({"columns": {"T_oa": "T"}}, lambda X: X, "T_oa"),
        ({"facades": {"south west": 225}}, lambda X: X, "south west"),
        ({}, lambda X: X.assign(q_sol_west=0.0), "q_sol_west"),
        ({}, lambda X: X.drop(X.index[5]), "not evenly spaced"),
    ],
)
def test_refusals_say_what_to_do(sky, settings, change, message):
    with pytest.raises(ValueError, match=message):
        FacadeIrradiance(**{**CHICAGO, **settings}).fit(change(sky))


def test_columns_in_and_out(sky):
    log = sky.rename(columns={"q_sol": "ghi"}).assign(u_heat=0.5, q_sol_beam=0.3, note="ok")
    facades = FacadeIrradiance(**CHICAGO, columns={"q_sol": "ghi"}, dni="q_sol_beam", facades={"garden": 200})
    for output in ("default", "pandas"):
        fitted = clone(facades).set_output(transform=output).fit(log)
        out = fitted.transform(log)
        # the direct irradiance is kept, as its column is named after a role
        assert list(out.columns) == ["T_oa", "ghi", "u_heat", "q_sol_beam", "note", "q_sol_garden"]
        assert list(fitted.get_feature_names_out()) == list(out.columns)
        pd.testing.assert_frame_equal(out[log.columns], log)
    named = FacadeIrradiance(**CHICAGO, start="2024-06-01", timezone="UTC", dni=3, sampling_time="1h").fit(
        np.zeros((4, 5))
    )
    assert list(named.get_feature_names_out()) == ["T_oa", "q_sol", "u_2", "u_4", *FACADES]


def test_a_single_row_takes_the_step_of_fit(sky):
    fitted = FacadeIrradiance(**CHICAGO).fit(sky.resample("1h").mean())
    hourly = fitted.transform(sky.resample("1h").mean())
    pd.testing.assert_frame_equal(fitted.transform(sky.resample("1h").mean().iloc[[12]]), hourly.iloc[[12]])


def test_a_pipeline_feeds_an_estimator_and_is_saved(sky, tmp_path):
    T_za = pd.Series(20.0 + np.sin(np.arange(len(sky)) / 15.0), sky.index)
    log = sky.assign(q_sol=1000 * sky["q_sol"], u_heat=(np.arange(len(sky)) % 7 < 3).astype(float))
    known = {"C_w": 20.0, "C_za": 3.0, "R_zw": 1.0, "R_zo": 5.0, "f": 0.3, "A_win": 2.0, "Q_h": 6.0}
    pipeline = make_pipeline(
        UnitConverter({"q_sol": "W/m2"}), FacadeIrradiance(**CHICAGO), GrayBoxRC(known=known, n_starts=1)
    ).set_output(transform="pandas")
    predicted = pipeline.fit(log, T_za).predict(log)
    assert np.isfinite(predicted).all()
    persistence.save_model(pipeline, tmp_path / "model.skh")
    np.testing.assert_array_equal(persistence.load_model(tmp_path / "model.skh").predict(log), predicted)


@pytest.mark.parametrize("column", ["q_sol", "beam", "sky"])
def test_irradiance_that_cannot_be_is_refused(column, sky):
    """Such as a fill value, which would count as zero."""
    sky = sky.assign(beam=0.1, sky=0.1)
    sky.iloc[[5, 7], sky.columns.get_loc(column)] = -999.0
    first = re.escape(f"(first at {sky.index[5]})")
    with pytest.raises(ValueError, match=f"column '{column}' holds -999 kW/m2 in 2 rows {first}.*fill value"):
        FacadeIrradiance(**CHICAGO, dni="beam", dhi="sky").fit_transform(sky)
