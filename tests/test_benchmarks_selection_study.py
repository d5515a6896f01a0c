"""The study of the design matrix (benchmarks/selection_study.py): that its part is even, and what its tables count."""

import signal
import sys
import time
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "benchmarks"))

import _study_baselines
import selection_study
from _study_claims import judge
from _study_cost import multiplications
from _study_plan import A_LEVEL, CLIMATES, KINDS, SIZES, planned, units
from _study_tables import even_part, how_against

from skhybrid.forecasting import list_cases, list_sizes

N_CASES = {"mlp": 21, "cnn": 21, "rnn": 17, "lstm": 17}


@pytest.fixture(scope="module")
def plan():
    return planned()


# -------------------------------------------------------------------------------------------------------------- sizes
@pytest.mark.parametrize("framework", SIZES)
def test_sizes_are_the_papers_and_none_comes_twice(framework):
    allowed = list_sizes(framework)
    assert len({tuple(sorted(size.items())) for size in SIZES[framework]}) == len(SIZES[framework])
    for size in SIZES[framework]:
        assert set(size) == set(allowed)
        assert all(value in allowed[name] for name, value in size.items())


@pytest.mark.parametrize("framework", ["mlp", "rnn", "lstm"])
def test_each_level_has_each_depth_and_each_activation_once(framework):
    sizes = SIZES[framework]
    for start in range(0, len(sizes), A_LEVEL):
        level = sizes[start : start + A_LEVEL]
        assert sorted(size["n_layers"] for size in level) == [1, 2, 4]
        assert sorted(size["activation"] for size in level) == ["gelu", "relu", "selu"]
        assert len({size["hidden_size"] for size in level}) == A_LEVEL


def test_the_nine_of_the_mlp_pair_every_depth_with_every_activation():
    pairs = {(size["n_layers"], size["activation"]) for size in SIZES["mlp"]}
    assert pairs == set(product((1, 2, 4), ("relu", "selu", "gelu")))
    widths = pd.Series([size["hidden_size"] for size in SIZES["mlp"]]).value_counts()
    assert set(widths.index) == {10, 20, 50, 100}
    assert widths.max() - widths.min() == 1


def test_the_six_of_the_cnn_pair_every_depth_with_every_width():
    table = pd.DataFrame(SIZES["cnn"])
    assert set(zip(table["n_layers"], table["hidden_size"], strict=True)) == set(product((1, 2), (10, 50, 100)))
    for column in ("activation", "filter_size"):
        counts = table[column].value_counts()
        assert counts.min() == counts.max()
    assert (table["n_channels"] == 10).all()
    assert (table["pool_size"] == 4).all()
    for start in (0, A_LEVEL):
        assert table["hidden_size"].iloc[start : start + A_LEVEL].nunique() == A_LEVEL


@pytest.mark.parametrize("framework", SIZES)
def test_two_levels_tell_depth_width_and_activation_apart(framework):
    table = pd.DataFrame(SIZES[framework][: 2 * A_LEVEL])
    columns = [np.ones(len(table)), table["n_layers"], table["hidden_size"]]
    columns += [table["activation"] == name for name in ("selu", "gelu")]
    assert np.linalg.matrix_rank(np.column_stack(columns).astype(float)) == len(columns)


# --------------------------------------------------------------------------------------------------------------- plan
def test_every_level_is_even_over_cases_disturbances_and_climates(plan):
    networks = plan[plan["level"] > 0]
    counts = networks.groupby(["level", "framework", "case", "disturbance", "climate"]).size()
    for (level, framework), here in counts.groupby(level=[0, 1]):
        assert len(here) == N_CASES[framework] * len(KINDS) * len(CLIMATES)
        assert (here == A_LEVEL).all(), (level, framework)
    assert {framework: N_CASES[framework] for framework in SIZES} == list_cases()["model"].value_counts().to_dict()


def test_a_store_knows_every_candidate_by_another_id(plan):
    assert not plan.duplicated(["climate", "id"]).any()
    assert plan.groupby("id")["climate"].nunique().eq(len(CLIMATES)).all()


def test_climates_and_disturbances_take_turns_and_the_cheap_come_first():
    order = list(units([1]))
    networks = [unit for unit in order if unit.level]
    assert [unit.framework for unit in order[:4]] == ["baselines"] * 4
    assert list(dict.fromkeys(unit.framework for unit in networks)) == ["mlp", "rnn", "lstm", "cnn"]
    for start in range(0, len(networks), 4):
        four = networks[start : start + 4]
        assert len({(unit.framework, unit.size) for unit in four}) == 1
        assert {(unit.disturbance, unit.climate) for unit in four} == set(product(KINDS, CLIMATES))


def test_sizes_may_take_turns_too():
    by_size = list(units([1, 2], by_size=True))
    assert sorted(by_size) == sorted(units([1, 2]))
    assert [(unit.framework, unit.size) for unit in by_size[4:36:4]] == [
        (framework, size) for size in (0, 1) for framework in ("mlp", "rnn", "lstm", "cnn")
    ]


def test_a_later_level_starts_from_what_an_earlier_one_has_left(plan):
    first = planned([1])
    assert set(first["id"]) < set(plan["id"])


# ---------------------------------------------------------------------------------------------------------------- run
def test_the_time_limit_ends_a_run_between_and_within_searches(tmp_path, monkeypatch):
    seen = []

    def forever(store, unit, data, n_jobs):
        seen.append(unit)
        time.sleep(60.0)

    monkeypatch.setattr(selection_study, "load", lambda climate: None)
    monkeypatch.setattr(_study_baselines, "run", lambda *given: None)
    monkeypatch.setattr(selection_study, "search", forever)
    before = signal.getsignal(signal.SIGTERM)
    begun = time.monotonic()
    assert not selection_study.run(tmp_path, 0.2 / 3600.0, list(units([1])), 1)
    assert time.monotonic() - begun < 30.0
    assert len(seen) == 1
    assert signal.getsignal(signal.SIGTERM) is before


# ------------------------------------------------------------------------------------------------------------- tables
def made_results(plan):
    rng = np.random.default_rng(0)
    return plan.assign(rmse=0.5 + rng.random(len(plan)), error=None)


def test_a_size_that_is_unfinished_anywhere_is_left_out(plan):
    results = made_results(plan)
    whole = even_part(results)
    assert len(whole) == (plan["level"] > 0).sum()
    first = results.index[(results["framework"] == "lstm") & (results["case"] == "case07")][0]
    size = results.loc[first, ["n_layers", "hidden_size", "activation"]]
    results.loc[first, "rmse"] = np.nan
    left = even_part(results)
    assert len(left) == len(whole) - 17 * 4
    same = (left[["n_layers", "hidden_size", "activation"]] == size).all(axis=1)
    assert not (same & (left["framework"] == "lstm")).any()


def test_a_failed_candidate_leaves_its_size_in(plan):
    results = made_results(plan)
    first = results.index[results["framework"] == "rnn"][0]
    results.loc[first, ["rmse", "error"]] = [np.nan, "ValueError: no"]
    assert len(even_part(results)) == (plan["level"] > 0).sum() - 1


def test_hour_of_week_is_set_against_its_twins_alone():
    # recurrent case01 reads the hour of week, case05 the day of week, case06 the weekday; nothing else differs
    rows = [("lstm", "case01", 1.0), ("lstm", "case05", 2.0), ("lstm", "case06", 4.0), ("lstm", "case17", 9.0)]
    rows += [("mlp", "case05", 1.0), ("mlp", "case12", 3.0), ("mlp", "case18", 50.0)]  # case18 reads the mode too
    table = pd.DataFrame(rows, columns=["framework", "case", "rmse"]).assign(disturbance="input")
    assert how_against(table, "dow") == pytest.approx(-np.log(2 * 3) / 2)
    assert how_against(table, "weekday") == pytest.approx(-np.log(4))
    assert how_against(table.iloc[:1], "dow") is None


def test_multiplications_of_a_network_counted_by_hand():
    size = {"n_layers": 2, "hidden_size": 10, "n_channels": 10, "filter_size": 6, "pool_size": 4}
    flat = 24 * (1 + 4 + 2) + 24 * (4 + 2)  # case01: a day of zeta, hour of week (4) and weather; a day of the last two
    mlp = pd.Series({"framework": "mlp", "case": "case01", **size})
    assert multiplications(mlp) == pytest.approx(1e-6 * (flat * 10 + 10 * 10 + 10 * 24))
    pooled = [flat, flat // 4, flat // 4 // 4]
    convolutions = [pooled[0] * 6 * 10, pooled[1] * 6 * 100, pooled[2] * 6 * 100]
    head = pooled[2] // 4 * 10 * 10 + 10 * 24
    assert multiplications(mlp.replace("mlp", "cnn")) == pytest.approx(1e-6 * (sum(convolutions) + head))
    cell = 4 * 10 * (8 + 10) + 4 * 10 * (10 + 10)
    assert multiplications(mlp.replace("mlp", "lstm")) == pytest.approx(1e-6 * (48 * cell + 24 * 110))


def test_a_verdict_follows_the_numbers():
    facts = {"oakland": {"P(time)": 0.99, "P(LSTM)": 0.3}, "chicago": {"P(time)": 0.5}}
    table = judge(facts)
    time_row = table.loc["time features reduce the error (0.95 or more)"]
    assert time_row["oakland"].startswith("holds")
    assert time_row["chicago"].startswith("does not hold")
    lstm_row = table.loc["LSTM reduces it"]
    assert lstm_row["oakland"].startswith("does not hold")
    assert lstm_row["chicago"] == "not applicable to this part"


def test_the_page_quotes_the_table():
    root = Path(__file__).resolve().parents[1]
    table = pd.read_csv(root / "benchmarks" / "results" / "selection_study.csv")
    errors = dict(zip(zip(table["framework"], table["climate"], strict=True), table["rmse"], strict=True))
    text = " ".join((root / "docs" / "results" / "study.rst").read_text(encoding="utf-8").split())
    without = [f"{errors['OD, no disturbance', climate]:.2f} K" for climate in ("oakland", "chicago")]
    alone = {f"{errors['OD alone', climate]:.2f} K" for climate in ("oakland", "chicago")}
    assert f'("OD, no disturbance"), has {without[0]} in Oakland and {without[1]} in Chicago.' in text
    assert len(alone) == 1
    assert f'("OD alone"), has {alone.pop()} in both.' in text


def test_the_page_says_what_the_offices_say():
    root = Path(__file__).resolve().parents[1]
    results = pd.read_csv(root / "benchmarks" / "results" / "selection_study_offices.csv")
    wide = results.pivot_table(index=["climate", "office"], columns="model", values="rmse")
    assert len(wide) == 14
    assert (wide.idxmin(axis=1) == "default").all()
    assert (wide["ridge"] < wide[["the choice", "the choice on all days"]].min(axis=1)).all()
    assert (wide["the choice"] < wide["OD alone"]).groupby("climate").sum().to_dict() == {"chicago": 2, "oakland": 7}
    oakland, chicago = (wide.loc[climate].median() for climate in ("oakland", "chicago"))
    text = " ".join((root / "docs" / "results" / "study.rst").read_text(encoding="utf-8").split())
    assert f"medians of {oakland['default']:.3f} K in Oakland and {chicago['default']:.3f} K in Chicago" in text
    pairs = [f"{of['ridge']:.3f} against {of['the choice']:.3g} K" for of in (oakland, chicago)]
    assert pairs == ["0.524 against 0.747 K", "0.572 against 1.6 K"]
    assert "(0.524 against 0.747 K, and 0.572 against 1.60 K)" in text
