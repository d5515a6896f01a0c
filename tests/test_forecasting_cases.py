"""The model cases against rows of the paper's tables, and the features of a case."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from skhybrid._table import ZoneTable
from skhybrid.forecasting import DisturbanceForecaster, ModelCase, list_cases, list_sizes
from skhybrid.forecasting.cases import cases_of, resolve_case
from skhybrid.forecasting.features import encode_time, known_at, last_same_slot, plant_mode

# rows of tables a1 (MLP, CNN) and a2 (RNN, LSTM): days | past | future.
PAPER = {
    ("mlp", "case01"): "1 | zeta how T_oa q_sol | how T_oa q_sol",
    ("mlp", "case02"): "4 | zeta | T_oa q_sol",
    ("cnn", "case04"): "4 | zeta weekday | weekday T_oa q_sol",
    ("cnn", "case10"): "7 | zeta how T_oa q_sol | how T_oa q_sol",
    ("mlp", "case13"): "7 | zeta dow T_oa q_sol | dow T_oa q_sol",
    ("mlp", "case16"): "4 | zeta weekday T_oa q_sol i_heat i_cool | dow T_oa q_sol",
    ("cnn", "case21"): "7 | zeta how T_oa q_sol i_heat i_cool | dow T_oa q_sol",
    ("lstm", "case01"): "1 | zeta how T_oa q_sol | how T_oa q_sol",
    ("rnn", "case02"): "1 | zeta how | how",
    ("lstm", "case04"): "1 | zeta hod T_oa q_sol | hod T_oa q_sol",
    ("rnn", "case12"): "2 | zeta weekday T_oa q_sol | weekday T_oa q_sol",
    ("lstm", "case17"): "7 | zeta dow T_oa q_sol | dow T_oa q_sol",
}


@pytest.mark.parametrize("key", PAPER, ids="-".join)
def test_a_case_is_the_paper_s_row(key):
    model, name = key
    days, past, future = (part.split() for part in PAPER[key].split("|"))
    case = resolve_case(name, model)
    assert (case.name, case.pattern_days, case.past, case.future) == (name, int(days[0]), tuple(past), tuple(future))


def test_there_are_21_and_17_cases_and_all_differ():
    counts = {model: len(cases_of(model)) for model in ("mlp", "cnn", "rnn", "lstm")}
    assert counts == {"mlp": 21, "cnn": 21, "rnn": 17, "lstm": 17}
    for model in counts:
        content = {(case.pattern_days, case.past, case.future) for case in cases_of(model).values()}
        assert len(content) == counts[model]
        assert all(case.past[0] == "zeta" for case in cases_of(model).values())
    # in table a2 past and future differ only by zeta
    assert all(case.past == ("zeta", *case.future) for case in cases_of("lstm").values())


def test_days_are_those_of_the_paper_s_tables():
    days = {model: "".join(map(str, list_cases(model)["pattern_days"])) for model in ("cnn", "rnn")}
    assert days == {"cnn": "144444777774747474747", "rnn": "11111124747247247"}


def test_cases_as_a_table():
    table = list_cases()
    assert list(table.columns) == ["model", "name", "pattern_days", "past", "future"]
    assert len(table) == 2 * 21 + 2 * 17
    assert len(list_cases("rnn")) == 17


@pytest.mark.parametrize("name", ["DEEP_AR_LSTM_FORECAST-case01", "LSTM-case01", "case01"])
def test_long_names_of_the_paper_are_known(name):
    assert resolve_case(name, "lstm") is cases_of("lstm")["case01"]


@pytest.mark.parametrize("name", ["DEEP_AR_LSTM_FORECAST-case01", "case22", "", "case1"])
def test_an_unknown_case_is_refused(name):
    with pytest.raises(ValueError, match="is not known for model='mlp'; use case01"):
        resolve_case(name, "mlp")


def test_a_case_of_the_user():
    mine = ModelCase("mine", 3, ["zeta", "hod"], ["hod", "T_oa"])
    assert resolve_case(mine, "lstm") is mine
    assert mine.past == ("zeta", "hod")
    assert mine.features == ("zeta", "hod", "T_oa")
    for wrong, message in [
        ({"past": ("CO2",)}, "past of case 'x' has the unknown feature 'CO2'"),
        ({"future": ("zeta",)}, "not known ahead"),
        *[
            ({"pattern_days": days}, "case 'x': pattern_days=.* must be an integer")
            for days in (0, 8.0, None, "4", True)
        ],
        ({"past": (), "future": ()}, "has no feature"),
        ({"past": "zeta"}, "past='zeta' of case 'x' must be a sequence of features"),  # a comma is missing
        ({"past": ("how", "zeta", "how")}, "past of case 'x' has 'how' twice"),
        ({"name": None}, "name=None of a case must be text"),
        ({"future": None}, "future=None of case 'x' must be a sequence of features"),
    ]:
        with pytest.raises(ValueError, match=message):
            ModelCase(**({"name": "x", "pattern_days": 1, "past": ("zeta",), "future": ()} | wrong))


# ------------------------------------------------------------------------------------------------------------ features
HOURS = pd.date_range("2023-07-03", periods=24 * 14, freq="1h")  # a Monday
TWO_WEEKS = ZoneTable({}, {}, HOURS, HOURS, None, pd.Timedelta("1h"))


def test_time_is_encoded_by_its_names():
    np.testing.assert_array_equal(encode_time(TWO_WEEKS, "how", "ordinal")[:, 0], np.tile(np.arange(168), 2))
    np.testing.assert_array_equal(encode_time(TWO_WEEKS, "hod", "onehot").argmax(axis=1), np.tile(np.arange(24), 14))
    np.testing.assert_array_equal(encode_time(TWO_WEEKS, "dow", "ordinal")[:, 0], np.repeat(np.arange(14) % 7, 24))
    assert encode_time(TWO_WEEKS, "how", "onehot").shape == (336, 168)
    weekday = encode_time(TWO_WEEKS, "weekday", "cyclic")[:, 0]
    np.testing.assert_array_equal(weekday, (HOURS.day_of_week < 5).astype(float))


@pytest.mark.parametrize(("feature", "period", "n_columns"), [("how", 168, 4), ("hod", 24, 2), ("dow", 168, 2)])
def test_cyclic_time_repeats_and_tells_hours_apart(feature, period, n_columns):
    columns = encode_time(TWO_WEEKS, feature, "cyclic")
    assert columns.shape == (336, n_columns)
    np.testing.assert_allclose(columns[:168], columns[168:], atol=1e-12)
    rows = columns[:period] if feature != "dow" else columns[:period:24]
    assert len(np.unique(rows.round(9), axis=0)) == len(rows)


def test_plant_modes_come_from_stages_or_from_the_sign_of_heat():
    stages = {"u_heat": np.array([0.0, 0.4, 0.0]), "u_cool": np.array([0.0, 0.0, 1.0])}
    np.testing.assert_array_equal(plant_mode(stages, "heat", 3), [0, 1, 0])
    np.testing.assert_array_equal(plant_mode(stages, "cool", 3), [0, 0, 1])
    heat = {"Q_hvac": np.array([2.0, 0.0, -3.0])}
    np.testing.assert_array_equal(plant_mode(heat, "heat", 3), [1, 0, 0])
    np.testing.assert_array_equal(plant_mode(heat, "cool", 3), [0, 0, 1])
    np.testing.assert_array_equal(plant_mode({}, "heat", 3), [0, 0, 0])


def test_the_past_is_read_as_known_at_the_origin():
    series = np.arange(10.0)
    origins = np.array([4, 8])
    np.testing.assert_array_equal(
        known_at(series, np.array([[-1, 3, 5], [8, 9, 0]]), origins), [[np.nan, 3, np.nan], [8, np.nan, 0]]
    )
    series[2] = np.nan
    # period 3, leads 1 ... 4 of origin 4: rows 5, 6, 7, 8 -> 2 (missing), 3, 4, and 8 - 6 = 2 (missing).
    rows = 4 + np.arange(1, 5)[None, :]
    np.testing.assert_array_equal(last_same_slot(series, rows, origins[:1], 3, 1), [[np.nan, 3, 4, np.nan]])
    np.testing.assert_array_equal(last_same_slot(series, rows, origins[:1], 3, 2), [[np.nan, 3, 4, np.nan]])
    np.testing.assert_array_equal(last_same_slot(series, rows - 1, origins[:1], 3, 2)[0, 2:], [3, 4])


def test_sizes_are_those_of_the_paper_s_section_3_2():
    activation = ["relu", "selu", "gelu"]
    recurrent = {"n_layers": [1, 2, 4], "hidden_size": [10, 20, 40, 60], "activation": activation}
    mlp = {"n_layers": [1, 2, 4], "hidden_size": [10, 20, 50, 100], "activation": activation}
    cnn = {"n_layers": [1, 2], "hidden_size": [10, 50, 100], "n_channels": [10, 50, 100]}
    cnn |= {"filter_size": [6, 12], "pool_size": [0, 4], "activation": activation}
    for model, sizes in {"mlp": mlp, "cnn": cnn, "rnn": recurrent, "lstm": recurrent}.items():
        assert list_sizes(model) == sizes
        assert set(sizes) <= set(DisturbanceForecaster(model).get_params())
    with pytest.raises(ValueError, match="no cases"):
        list_sizes("gru")
