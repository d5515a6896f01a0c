"""The design matrix: the paper's counts, the grids that GridSearchCV takes, frameworks and cases of one's own."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.ensemble import RandomForestRegressor
from sklearn.linear_model import Ridge
from sklearn.model_selection import ParameterGrid

from skhybrid import DisturbanceForecaster, TwoStagePredictor
from skhybrid.forecasting import ModelCase
from skhybrid.forecasting.cases import resolve_case
from skhybrid.model_selection import design_matrix
from skhybrid.model_selection.choice.results_table import ingredients

#: paper 3.2 and appendix: cases x layers x widths x ... x activations.
PAPER = {"mlp": 21 * 3 * 4 * 3, "cnn": 21 * 2 * 3 * 3 * 2 * 2 * 3, "rnn": 17 * 3 * 4 * 3, "lstm": 17 * 3 * 4 * 3}


@pytest.fixture(scope="module")
def paper():
    return design_matrix()


def test_the_full_grid_has_the_papers_counts(paper):
    assert PAPER == {"mlp": 756, "cnn": 4536, "rnn": 612, "lstm": 612}
    counts = paper.table.groupby(["framework", "disturbance"]).size()
    assert counts.to_dict() == {(name, kind): n for name, n in PAPER.items() for kind in ("input", "output")}
    assert len(paper) == 2 * 6516 == len(list(ParameterGrid(paper.param_grid())))


def test_every_candidate_is_another(paper):
    assert not paper.table.duplicated().any()


def test_the_table_and_the_grid_name_the_same_candidates(paper):
    candidates = paper.candidates()
    for row in (0, 5000, len(paper) - 1):
        seen, said = paper.table.loc[row], candidates[row]
        assert (seen["framework"], seen["case"], seen["disturbance"]) == (
            said["forecaster__model"],
            said["forecaster__case"],
            said["disturbance"],
        )
        sizes = {k.removeprefix("forecaster__"): v for k, v in said.items() if k.startswith("forecaster__")}
        del sizes["model"], sizes["case"]
        assert seen.drop(["framework", "case", "disturbance", "name"]).dropna().to_dict() == sizes


def test_sizes_that_a_framework_lacks_are_missing(paper):
    table = paper.table.set_index("framework")
    assert table.loc["lstm", ["n_channels", "filter_size", "pool_size"]].isna().all(axis=None)
    assert table.loc["cnn"].notna().all(axis=None)


def test_names_are_the_papers_and_the_forecaster_knows_them(paper):
    assert "DEEP_AR_LSTM_FORECAST-case01" in set(paper.table["name"])
    for framework, case, name in paper.table[["framework", "case", "name"]].drop_duplicates().itertuples(index=False):
        assert resolve_case(name, framework) is resolve_case(case, framework)
    assert paper.table["name"].nunique() == 2 * 21 + 2 * 17


@pytest.mark.parametrize(
    ("prefix", "estimator"), [("forecaster__", TwoStagePredictor()), ("", DisturbanceForecaster("ridge"))]
)
def test_an_estimator_takes_every_candidate(prefix, estimator):
    matrix = design_matrix(size="small", cases=["case01"])
    for params in matrix.candidates(prefix):
        changed = clone(estimator).set_params(**params).get_params()
        assert {name: changed[name] for name in params} == params
    assert len(matrix.candidates(prefix)) == len(matrix) // (1 if prefix else 2)


def test_a_framework_a_case_and_sizes_of_ones_own():
    case = ModelCase("mine", 2, ("zeta", "how"), ("how",))
    matrix = design_matrix(
        frameworks={"mlp": "mlp", "forest": RandomForestRegressor(), "hour of week": "profile"},
        cases=["case02", case],
        disturbance="input",
        size={"mlp": {"hidden_size": [3, 4], "n_layers": 1}, "forest": {"n_estimators": [5, 10]}},
    )
    assert matrix.table["framework"].tolist() == ["mlp"] * 4 + ["forest"] * 2 + ["hour of week"]
    assert matrix.table["case"].tolist() == ["case02", "case02", "mine", "mine", None, None, None]
    assert matrix.table["n_estimators"].dropna().tolist() == [5, 10]
    assert [c.get("forecaster__model__n_estimators") for c in matrix.candidates()][4:6] == [5, 10]
    assert matrix.candidates()[2]["forecaster__case"] is case


def test_cases_that_differ_have_names_that_differ():
    mine, other = (ModelCase("mine", days, ("zeta",), ("how",)) for days in (1, 7))
    assert len(design_matrix(["lstm"], [mine, replace(mine)], "input", {"n_layers": [1]})) == 1
    for cases in ([mine, other], {"lstm": [mine], "mlp": [other]}):
        with pytest.raises(ValueError, match=r"'mine' has the name of another of your cases, but not its content"):
            design_matrix(["mlp", "lstm"], cases)
    with pytest.raises(ValueError, match=r"'case01' has the name of a case of the paper for lstm, but not its"):
        design_matrix({"own": "lstm"}, [replace(mine, name="case01")])
    rows = pd.DataFrame({"framework": ["lstm"], "case": ["mine"], "disturbance": ["input"]})
    with pytest.raises(ValueError, match="'mine' has the name of another"):
        ingredients(rows, [mine, other])
    with pytest.raises(ValueError, match="'case01' has the name of a case of the paper for lstm"):
        ingredients(rows.assign(case="case01"), [replace(mine, name="case01")])


def test_channels_of_a_common_size_are_the_cnns_alone():
    size = {"n_layers": [1], "n_channels": [2, 3], "max_epochs": [5, 6]}
    table = design_matrix(["mlp", "cnn"], ["case01"], "input", size).table
    assert table.groupby("framework").size().to_dict() == {"mlp": 2, "cnn": 4}
    assert set(table["max_epochs"]) == {5, 6}


def test_a_size_that_is_named_twice_is_one_candidate():
    sizes = {"hidden_size": [5, 10, 5], "n_layers": (1, 1), "activation": ["relu"]}
    assert len(design_matrix(["mlp"], ["case01"], "input", sizes)) == 2


def test_cases_by_framework():
    table = design_matrix(["mlp", "lstm", "ridge"], {"mlp": ["case21"]}, size="small").table
    assert table.groupby("framework")["case"].nunique().to_dict() == {"lstm": 17, "mlp": 1, "ridge": 0}


def test_a_framework_without_cases_passes_over_those_that_there_are():
    mine = ModelCase("mine", 2, ("zeta", "how"), ("how",))
    assert design_matrix(["ridge"], ["case01", mine], "input").table["case"].tolist() == [None]


def test_a_pipeline_has_the_disturbance_beside_the_forecaster():
    grid = design_matrix(["ridge"]).param_grid("hybrid__forecaster__")
    assert grid == [{"hybrid__forecaster__model": ["ridge"], "hybrid__disturbance": ["input", "output"]}]
    with pytest.raises(ValueError, match="prefix='forecaster' must end with '__'"):
        design_matrix(["ridge"]).param_grid("forecaster")


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"frameworks": ["gru"]}, "framework 'gru' is not known; use mlp"),
        ({"frameworks": {"mine": "gru"}}, "framework 'gru' is not known; use mlp"),
        ({"frameworks": {"r": Ridge}}, "regressor"),
        ({"frameworks": [Ridge()]}, "has no name"),
        ({"cases": ["case99"]}, "'case99' belongs to none"),
        ({"frameworks": ["lstm"], "cases": ["case18"]}, "'case18' belongs to none"),
        ({"frameworks": ["ridge"], "cases": ["case99"]}, "'case99' belongs to none of mlp, cnn, rnn, lstm"),
        ({"frameworks": ["ridge"], "cases": ["case01", "case99"]}, "'case99' belongs to none"),
        ({"cases": {"ridge": ["case01"]}}, "not a network"),
        ({"disturbance": "sideways"}, "'sideways'"),
        ({"size": "huge"}, "'huge'"),
        ({"size": {"mlp": {"wide": [1]}}}, "'wide' of 'mlp'"),
        ({"size": {"gru": {"n_layers": [1]}}}, "'gru'"),
        ({"size": {"n_layers": []}}, "no values"),
        ({"size": {"hidden_size": [4, 0]}}, "hidden_size=0 must be an integer of at least 1"),
        ({"frameworks": {"own": "cnn"}, "size": {"own": {"activation": "tanh"}}}, "activation='tanh' is not known"),
        ({"frameworks": []}, "empty"),
        ({"frameworks": 4}, "frameworks=4 must be a name, or a list of names"),
        ({"disturbance": None}, "disturbance=None must be a name, or a list"),
        ({"cases": 1}, "cases=1 must be a case, or a list of them, such as 'case01'"),
    ],
)
def test_what_is_not_known_is_named(given, said):
    with pytest.raises(ValueError, match=said):
        design_matrix(**given)


def test_the_table_is_plain():
    table = design_matrix(["mlp", "ridge"], ["case01"], size="small").table
    assert isinstance(table, pd.DataFrame)
    assert table["case"].isna().sum() == 2
    assert table.index.tolist() == list(range(len(table)))
