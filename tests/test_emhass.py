"""Parameters for EMHASS from identified networks, against known truth and EMHASS's own equation."""

from __future__ import annotations

import json

import numpy as np
import pytest

from skhybrid import HybridPredictor
from skhybrid.cli import main
from skhybrid.datasets import make_office
from skhybrid.forecasting import DisturbanceForecaster
from skhybrid.identification import GrayBoxRC, PeriodicDisturbanceID
from skhybrid.study import read_settings
from skhybrid.study.identified_building import describe
from skhybrid.study.settings import settings_from
from skhybrid.thermal import RCNetwork
from skhybrid.zone import ZoneModel, emhass_parameters
from skhybrid.zone.emhass import EmhassLaw, temperatures

COLUMNS = {role: role for role in ("T_za", "T_oa", "q_sol", "u_heat", "u_cool")}
STEP = 0.5  # of the plan [h]


def _settings(**given):
    return settings_from({"columns": COLUMNS, **given})


@pytest.fixture(scope="module")
def office():
    return make_office(n_days=21, random_state=0)


@pytest.fixture(scope="module")
def truth(office):
    """The office's own network."""
    return GrayBoxRC(known=dict(office.theta)).fit(office.X[:288], office.y[:288])


@pytest.fixture(scope="module")
def identified(office):
    return PeriodicDisturbanceID(known={"Q_h": 6.0}, n_starts=2, random_state=0).fit(office.X, office.y)


def _heated(gray_box, office, hours):
    """Temperatures of a network every half hour: from 10 degC on, 10 degC outdoors, full heating, no sun."""
    rows = office.X.iloc[: 4 * hours + 1].assign(T_oa=10.0, q_sol=0.0, u_heat=1.0, u_cool=0.0)
    return np.asarray(gray_box.simulate(rows, initial_state=np.full(len(gray_box.network_.states), 10.0)))[2::2]


def _difference(law, simulated):
    planned = temperatures(law, np.ones(len(simulated)), np.full(len(simulated), 10.0), 10.0, STEP)
    return float(np.sqrt(np.mean((planned - simulated) ** 2)))


def test_emhass_own_equation_reproduces_the_first_hours_of_the_office(office, truth):
    found = emhass_parameters(truth, _settings(), hours=6.0)
    law = EmhassLaw(*found.values["value"])
    simulated = _heated(truth, office, 6)
    error = _difference(law, simulated)
    assert error == pytest.approx(found.misfit, rel=1e-6)
    assert error < 0.13 * (simulated[-1] - 10.0)  # two time constants in one
    assert error < min(
        _difference(EmhassLaw(factor * law.heating_rate, law.cooling_constant), simulated) for factor in (0.97, 1.03)
    )
    # 6 kW hold a zone, whose only way out is R_zo, 6 R_zo above the outdoors
    assert law.heating_rate / law.cooling_constant == pytest.approx(6.0 * office.theta["R_zo"], rel=0.01)


def test_a_network_of_one_capacitance_is_the_law_itself(office):
    theta = {"C_za": 5.0, "R_zo": 8.0, "A_win": 3.0, "Q_h": 6.0, "Q_c": -4.0}
    gray_box = GrayBoxRC("1R1C", known=theta).fit(office.X[:288], office.y[:288])
    settings = _settings(estimator={"known": theta}, plant={"cop": 3.0})
    found = emhass_parameters(gray_box, settings, office.X)
    law = EmhassLaw(*found.values["value"].iloc[:2])
    assert _difference(law, _heated(gray_box, office, 12)) < 1e-8
    left = np.exp(-STEP / 40.0)
    assert law.cooling_constant == pytest.approx((1.0 - left) / STEP, rel=1e-9)
    assert law.heating_rate == pytest.approx(48.0 * (1.0 - left) / STEP, rel=1e-9)
    cooled = emhass_parameters(gray_box, settings, office.X, sense="cool")
    assert cooled.values.loc["heating_rate", "value"] == pytest.approx(32.0 * (1.0 - left) / STEP, rel=1e-9)
    battery = found.load["thermal_battery"]
    loss = battery["u_value"] * battery["envelope_area"] + 1.2 * 1.005 * battery["ventilation_rate"] / 3.6
    assert loss == pytest.approx(125.0)  # [W/K], as EMHASS computes it
    assert battery["window_area"] * battery["shgc"] == pytest.approx(3.0)
    assert battery["volume"] * battery["density"] * battery["heat_capacity"] / 3600.0 == pytest.approx(5.0, rel=0.12)
    assert found.nominal_power == 2000
    assert found.runtime_parameters("thermal_battery")["def_load_config"][0]["thermal_battery"]["efficiency"] == 3.0


@pytest.mark.parametrize(
    ("plant", "sense", "efficiency"),
    [
        ({"eer": 4.0}, "heat", 4.0),
        ({"cop": 3}, "cool", 3.0),
        ({"cop": 3.0, "eer": 4.0}, "cool", 4.0),
        ({"cop": [[-10, 2.0], [10, 4.0]]}, "heat", None),
        ({}, "heat", None),
    ],
)
def test_the_efficiency_is_that_of_the_nominal_power(truth, office, plant, sense, efficiency):
    """With the performance of one sense only, nominal power counted on it, and the efficiency was left out."""
    settings = _settings(estimator={"known": dict(office.theta)}, plant=plant)
    found = emhass_parameters(truth, settings, office.X, sense=sense)
    assert found.load["thermal_battery"].get("efficiency") == efficiency
    why = [text for name, text in found.left_out.items() if "carnot_efficiency" in name]
    assert len(why) == (efficiency is None)
    if efficiency:
        assert found.nominal_power == pytest.approx(6000.0 / efficiency, abs=1.0)
    else:
        assert ("by outdoor temperature, and EMHASS takes one number" if plant else "give cop in [plant]") in why[0]


def test_a_declared_network_gives_the_values_of_its_measured_node(office, truth):
    room = RCNetwork(
        "room first",
        {"room": "C_za", "w": "C_w"},
        {"R_zw": ("room", "w"), "R_zo": ("room", "T_oa")},
        {"room": "f", "w": None},
        **dict.fromkeys(("measured", "disturbed", "heated"), "room"),
    )
    rows = office.X[:288].rename(columns={"T_za": "T_room"})
    declared = GrayBoxRC(room, known=dict(office.theta)).fit(rows, office.y[:288])
    found, right = (emhass_parameters(one, _settings()).values["value"] for one in (declared, truth))
    np.testing.assert_allclose(found, right, rtol=1e-9)
    np.testing.assert_allclose(describe(declared)["value"], describe(truth)["value"].loc[describe(declared).index])


def test_standard_errors_are_those_of_the_parameters(office):
    """Of one capacitance: d cooling / d log R and / d log C are -exp(-dt / RC) / RC."""
    gray_box = GrayBoxRC("1R1C", n_starts=1, random_state=0, known={"Q_h": 6.0}).fit(office.X[:672], office.y[:672])
    tau = float(gray_box.theta_["R_zo"] * gray_box.theta_["C_za"])
    cov = gray_box.theta_cov_
    relative = {(a, b): cov.loc[a, b] / gray_box.theta_[a] / gray_box.theta_[b] for a in cov for b in cov}
    of_tau = sum(relative[a, b] for a in ("R_zo", "C_za") for b in ("R_zo", "C_za"))
    found = emhass_parameters(gray_box, _settings()).values
    expected = np.exp(-STEP / tau) / tau * np.sqrt(of_tau)
    assert found.loc["cooling_constant", "std"] == pytest.approx(expected, rel=1e-3)


def test_the_office_is_identified_within_its_standard_errors(truth, identified, office):
    settings = _settings(estimator={"known": {"Q_h": 6.0}})
    right = emhass_parameters(truth, settings, office.X).values["value"]
    found = emhass_parameters(identified, settings, office.X).values
    assert list(found.index) == ["heating_rate", "cooling_constant", "volume", "u_value", "window_area"]
    assert (found["std"] < 0.1 * found["value"]).all()
    assert ((found["value"] - right).abs() < 3.0 * found["std"]).all()


def test_what_the_data_do_not_tell_is_left_out_with_a_sentence(identified, office):
    unscaled = emhass_parameters(identified, _settings(), office.X)
    assert list(unscaled.values.index) == ["heating_rate", "cooling_constant"]
    assert "no kW is certain" in unscaled.left_out["u_value"]
    assert "full stage" in unscaled.left_out["nominal_power_of_deferrable_loads"]
    assert "product" in unscaled.left_out["window_area and shgc"]
    identified.theta_cov_, kept = 1e6 * identified.theta_cov_, identified.theta_cov_
    try:
        vague = emhass_parameters(identified, _settings(), office.X)
    finally:
        identified.theta_cov_ = kept
    assert "cooling_constant" not in vague.load["thermal_config"]
    assert "with a standard error of" in vague.left_out["cooling_constant"]


def test_a_plan_that_cannot_be(identified, office):
    with pytest.raises(ValueError, match="two steps or more"):
        emhass_parameters(identified, _settings(), hours=0.5)
    with pytest.raises(ValueError, match="sense='warm' is not one of 'heat', 'cool'"):
        emhass_parameters(identified, _settings(), sense="warm")
    with pytest.raises(ValueError, match="block='battery' is not one of 'thermal_config', 'thermal_battery'"):
        emhass_parameters(identified, _settings(), office.X).runtime_parameters("battery")
    for hours in (1e6, np.inf):
        with pytest.raises(ValueError, match="longer than a year"):
            emhass_parameters(identified, _settings(), hours=hours)
    heated = office.X[:672].assign(Q_hvac=6.0 * office.X["u_heat"]).drop(columns=["u_heat", "u_cool"])
    gray_box = GrayBoxRC(n_starts=1, random_state=0).fit(heated, office.y[:672])
    with pytest.raises(ValueError, match="none that can cool"):
        emhass_parameters(gray_box, _settings(), heated, sense="cool")
    most = emhass_parameters(gray_box, _settings(plant={"most_heat": 3.0}), heated).values
    usual = emhass_parameters(gray_box, _settings(), heated).values
    assert usual.loc["heating_rate", "value"] == pytest.approx(2.0 * most.loc["heating_rate", "value"], rel=1e-6)


def test_export_from_the_command_line(office, tmp_path, capsys):
    office.X[: 96 * 10].rename_axis("time").to_csv(tmp_path / "log.csv")
    lines = ["[columns]", *(f'{role} = "{role}"' for role in COLUMNS), "[estimator]"]
    (tmp_path / "zone.toml").write_text("\n".join([*lines, "n_starts = 1", "known = { Q_h = 6.0 }"]), encoding="utf-8")
    log, config, out, model = (str(tmp_path / name) for name in ("log.csv", "zone.toml", "e.json", "m.skops"))
    assert main(["export", "emhass", log, "--config", config, "--out", out, "--json", "-q"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert json.loads((tmp_path / "e.json").read_text(encoding="utf-8")) == said["runtime_parameters"]
    written = said["runtime_parameters"]["def_load_config"][0]["thermal_config"]
    assert written["heating_rate"] == pytest.approx(said["values"]["heating_rate"]["value"], rel=1e-3)
    assert said["values"]["heating_rate"]["std"] > 0.0
    assert main(["export", "emhass", log, "--config", config, "--log", str(tmp_path / "other.csv")]) == 2
    assert "is a log itself" in capsys.readouterr().err
    predictor = HybridPredictor(intervals=False).fit(office.X[:480], office.y[:480])
    ZoneModel(predictor, read_settings(config)).save(model)
    assert main(["export", "emhass", model]) == 1
    assert "give its log with --log" in capsys.readouterr().err
    folder = tmp_path / "kitchen"
    folder.mkdir()
    (tmp_path / "m.skops").rename(folder / "model.skops")
    (tmp_path / "zone.toml").rename(folder / "zone.toml")
    assert main(["export", "emhass", str(folder), "--log", log, "-q"]) == 0
    text = capsys.readouterr().out
    assert "What the log does not determine:" in text
    assert '"thermal_config"' in text


def test_a_two_stage_model_needs_no_log(office, tmp_path, capsys):
    gray_box = GrayBoxRC("1R1C", n_starts=1, random_state=0, known={"Q_h": 6.0})
    predictor = HybridPredictor(gray_box, DisturbanceForecaster("profile"), intervals=False)
    zone = ZoneModel(predictor.fit(office.X[:672], office.y[:672]), _settings())
    zone.save(tmp_path / "m.skops")
    assert main(["export", "emhass", str(tmp_path / "m.skops"), "--json", "-q"]) == 0
    said = json.loads(capsys.readouterr().out)["values"]["heating_rate"]
    expected = emhass_parameters(zone.predictor.gray_box_, _settings()).values.loc["heating_rate"]
    assert said["value"] == pytest.approx(expected["value"])
    assert said["std"] == pytest.approx(expected["std"])
