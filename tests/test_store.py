"""The store of a search: claims, heartbeats, refusal of other data."""

from __future__ import annotations

import importlib
import os
import resource
import sqlite3
import subprocess
import sys
import tempfile
from contextlib import closing
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import Ridge
from sklearn.metrics import make_scorer, mean_squared_error
from sklearn.preprocessing import FunctionTransformer

from skhybrid import DisturbanceForecaster
from skhybrid.exceptions import SkhybridWarning
from skhybrid.forecasting.arx_prior import ARXPrior
from skhybrid.model_selection.search.candidates import candidate_id, settings_of
from skhybrid.model_selection.search.store import Result, ResultStore, Task
from skhybrid.parallel.stored_settings import as_plain

GOOD = Result({"score": -0.1 - 0.2}, 0.1 + 0.2, 1.0, 0.5, 7, None)
BAD = Result({}, float("nan"), 1.0, 0.0, None, "ValueError: no")
TASKS = [Task("a", 0), Task("a", 1), Task("b", 0)]


@pytest.fixture
def path(tmp_path):
    return tmp_path / "new folder" / "results.sqlite"


def test_results_come_back_to_the_bit(path):
    with ResultStore(path, {"rows": "3"}) as store:
        store.finish({TASKS[0]: GOOD, TASKS[2]: BAD})
    with ResultStore(path, {"rows": "3"}) as store:
        found = store.results()
    assert found[TASKS[0]] == GOOD
    assert found[TASKS[2]].error == BAD.error
    assert np.isnan(found[TASKS[2]].rmse)
    assert set(found) == {TASKS[0], TASKS[2]}


def test_scores_without_a_finite_value_come_back_from_the_file(path):
    scores = {"undefined": float("nan"), "worst": float("-inf"), "good": 0.1 + 0.2}
    with ResultStore(path, {}) as store:
        store.finish({TASKS[0]: GOOD._replace(scores=scores)})
    with ResultStore(path, {}) as store:
        assert repr(store.results()[TASKS[0]].scores) == repr(scores)


def test_two_stores_share_out_the_tasks(path):
    with ResultStore(path, {}) as one, ResultStore(path, {}) as other:
        assert one.claim(TASKS[:2]) == TASKS[:2]
        assert other.claim(TASKS) == TASKS[2:]
        one.finish({TASKS[0]: GOOD})
        assert other.claim(TASKS) == []
        one.close()  # gives back what it has not finished
        assert other.claim(TASKS) == [TASKS[1]]


def test_what_was_finished_first_stays(path):
    with ResultStore(path, {}) as one, ResultStore(path, {}) as other:
        one.finish({TASKS[0]: GOOD})
        other.finish({TASKS[0]: BAD})
        assert one.results() == {TASKS[0]: GOOD}


def test_claims_of_a_process_that_died_are_free_at_once(path):
    program = (
        "import os, sys\nfrom skhybrid.model_selection.search.store import ResultStore, Task\n"
        "store = ResultStore(sys.argv[1], {})\nassert store.claim([Task('a', 0)])\nos.kill(os.getpid(), 9)"
    )
    path.parent.mkdir()
    done = subprocess.run([sys.executable, "-c", program, str(path)], check=False, capture_output=True, timeout=60)
    assert done.returncode == -9, done.stderr
    with ResultStore(path, {}, lease=1e6) as store:
        assert store.claim(TASKS) == TASKS


def test_claims_without_a_heartbeat_lapse(path):
    with ResultStore(path, {}) as silent, ResultStore(path, {}, lease=60.0) as other:
        assert silent.claim(TASKS) == TASKS
        assert other.claim(TASKS) == []
        elsewhere = sqlite3.connect(path)
        with elsewhere:  # a machine elsewhere, silent for longer than the lease
            elsewhere.execute("UPDATE owner SET host = 'elsewhere', seen = seen - 61 WHERE id = ?", (silent.owner,))
        elsewhere.close()
        assert other.claim(TASKS) == TASKS


def test_heartbeats_keep_claims_alive(path):
    with ResultStore(path, {}, lease=0.2) as one, ResultStore(path, {}, lease=0.2) as other:
        one.claim(TASKS)
        for _ in range(8):
            assert not other._closed.wait(0.1)
            assert other.claim(TASKS) == []


def test_other_data_are_refused_with_the_difference(path):
    ResultStore(path, {"rows of X": "96", "scoring": "None"}).close()
    with pytest.raises(ValueError, match=r"rows of X is 96 there and 97 here; weeks is absent there and 2 here"):
        ResultStore(path, {"rows of X": "97", "scoring": "None", "weeks": "2"})
    other = path.with_name("other.sqlite")
    ResultStore(other, {"version of torch": "1"}).close()
    with pytest.warns(SkhybridWarning, match="version of torch is 1 there and 2 here") as found:
        ResultStore(other, {"version of torch": "2"}).close()
    assert found[0].filename == __file__


def test_another_kind_of_file_is_refused(path):
    path.parent.mkdir()
    path.write_text("a table of results that somebody wrote by hand\n" * 100, encoding="utf-8")
    with pytest.raises(
        OSError, match=r"results\.sqlite cannot be used \(file is not a database\); give the path of an"
    ):
        ResultStore(path, {})
    assert path.read_text(encoding="utf-8").startswith("a table")


def test_a_database_of_another_program_is_left_as_it_is(path):
    path.parent.mkdir()
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE photos (name TEXT)")
    before = path.read_bytes()
    with pytest.raises(OSError, match="is a database of another program, with a table 'photos'; give the path of ano"):
        ResultStore(path, {})
    assert path.read_bytes() == before


def test_failed_ones_are_tried_again_when_asked(path):
    with ResultStore(path, {}) as store:
        store.finish({TASKS[0]: GOOD, TASKS[1]: BAD})
        assert store.claim(TASKS[:2]) == []
        assert store.forget_failed() == 1
        assert store.claim(TASKS[:2]) == [TASKS[1]]


def test_without_a_path_results_stay_in_memory():
    with ResultStore(None, {}) as store:
        assert store.claim(TASKS) == TASKS
        store.finish({TASKS[0]: GOOD})
        assert store.results(["a"]) == {TASKS[0]: GOOD}
        assert store.results(["b"]) == {}


# ------------------------------------------------------------------------------------------------------------- the disk
def _filled(path):
    with ResultStore(path, {}) as store:
        store.finish({TASKS[0]: GOOD})


def test_a_full_disk_is_named_and_results_are_kept(path):
    store = ResultStore(path, {})
    store.finish({TASKS[0]: GOOD})
    pages = store._db.execute("PRAGMA page_count").fetchone()[0]
    store._db.execute(f"PRAGMA max_page_count = {pages}")
    long = BAD._replace(error="x" * 100_000)
    with pytest.raises(OSError, match=r"results\.sqlite cannot be used \(database or disk is full\); free some space"):
        store.finish({TASKS[1]: long})
    assert store.results() == {TASKS[0]: GOOD}
    store.close()
    with ResultStore(path, {}) as again:
        assert again.results() == {TASKS[0]: GOOD}
        again.finish({TASKS[1]: long})


def _fill_the_disk_and_fail(store):
    """The disk fills up between two results; then something else fails."""
    soft, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    with store:
        store.claim(TASKS)
        resource.setrlimit(resource.RLIMIT_FSIZE, (1, most))
        try:
            with pytest.raises(OSError, match=r"results\.sqlite cannot be used .*what it holds is kept"):
                store.finish({TASKS[1]: GOOD})
            store.close()  # cannot give back its claims
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, (soft, most))
        raise RuntimeError("the cause")


def test_a_disk_that_fills_up_hides_no_other_error(path):
    _filled(path)
    with pytest.raises(RuntimeError, match="the cause"):
        _fill_the_disk_and_fail(ResultStore(path, {}))
    with ResultStore(path, {}) as again:
        assert again.results() == {TASKS[0]: GOOD}


def test_a_corrupt_store_is_named_and_left_as_it_is(path):
    _filled(path)
    content = bytearray(path.read_bytes())
    content[100:] = b"\xff" * (len(content) - 100)
    path.write_bytes(content)
    with pytest.raises(
        OSError, match=r"results\.sqlite cannot be used \(.*malformed.*\); give the path of another file"
    ):
        ResultStore(path, {})
    assert path.read_bytes() == content


def test_a_store_that_breaks_while_it_is_used_is_named(path):
    with ResultStore(path, {}) as store:
        store._db.execute("DROP TABLE result")
        for use in (store.results, lambda: store.claim(TASKS), lambda: store.finish({TASKS[0]: GOOD})):
            with pytest.raises(OSError, match=r"results\.sqlite cannot be used \(no such table: result\)"):
                use()


@pytest.mark.parametrize("text", ['{"test_score": "b"}', "[1.0]", '{"test_score": null}', "{"])
def test_scores_that_are_none_are_named(path, text):
    _filled(path)
    with ResultStore(path, {}) as store:
        store._db.execute("UPDATE result SET scores = ?", (text,))
        with pytest.raises(
            OSError, match=r"results\.sqlite cannot be used \(scores are '.*'\); give the path of another"
        ):
            store.results()


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["folder", "below a file", "null"])
def test_a_path_that_is_no_file_is_named(tmp_path, kind):
    (tmp_path / "file").write_text("", encoding="utf-8")
    place = {"folder": tmp_path, "below a file": tmp_path / "file" / "a.sqlite", "null": "/dev/null"}[kind]
    with pytest.raises(OSError, match=rf"store {place} (is not a file|cannot be created).*give the path of another"):
        ResultStore(place, {})
    with pytest.raises(OSError, match=r"store=3 is no path; give that of a file, or None"):
        ResultStore(3, {})
    with pytest.raises(OSError, match=r"store is an empty path, .*; give the path of a file"):
        ResultStore("", {})


def test_a_read_only_store_is_named():
    """As a user without rights, since files are never read-only for root."""
    program = (
        "import os, sys\nfrom skhybrid.model_selection.search.store import ResultStore\n"
        "if os.getuid() == 0: os.seteuid(65534)\nResultStore(sys.argv[1], {})"
    )
    with tempfile.TemporaryDirectory() as made:  # another run may close the folders above those of pytest
        path = Path(made) / "results.sqlite"
        _filled(path)
        path.chmod(0o444)
        path.parent.chmod(0o555)
        done = subprocess.run([sys.executable, "-c", program, str(path)], capture_output=True, text=True, timeout=60)
        path.parent.chmod(0o755)
    assert f"StoreError: store {path} cannot be used (" in done.stderr
    assert "writable, or give the path of another file." in done.stderr


# -------------------------------------------------------------------------------------------------------- fingerprint
def _settings(**changed):
    index = pd.date_range("2025-01-06", periods=48, freq="1h", tz="America/Chicago")
    X = pd.DataFrame({"T_oa": np.arange(48.0), "q_sol": 0.5}, index=index)
    given = {"estimator": DisturbanceForecaster("ridge"), "X": X, "y": X["T_oa"] * 2, "scoring": None}
    given |= {"splits": [(np.arange(24), np.arange(24, 48))]} | changed
    return settings_of(**given)


def _differs(**changed):
    here, there = _settings(), _settings(**changed)
    return sorted(name for name in {**here, **there} if here.get(name) != there.get(name))


def test_the_fingerprint_names_what_differs():
    index = pd.date_range("2025-01-06", periods=48, freq="1h", tz="America/Chicago")
    X = pd.DataFrame({"T_oa": np.arange(48.0), "q_sol": 0.5}, index=index)
    assert _differs() == []
    assert _differs(X=X.assign(q_sol=np.r_[np.full(47, 0.5), 0.5 + 1e-15])) == ["values of X"]
    assert _differs(X=X.rename(columns={"q_sol": "sun"})) == ["columns of X"]
    assert _differs(X=X.tz_convert("UTC")) == ["first stamp of X", "last stamp of X"]
    assert _differs(splits=[(np.arange(23), np.arange(24, 48))]) == ["cv"]
    assert _differs(scoring="r2") == ["scoring"]
    assert _differs(scoring=make_scorer(mean_squared_error)) == ["scoring"]
    assert _differs(estimator=DisturbanceForecaster("ridge", patience=3)) == ["parameter patience"]
    assert _differs(estimator=DisturbanceForecaster("ridge", verbose=1)) == []


@pytest.mark.slow
def test_values_in_words_are_the_same_in_another_process():
    values = [Ridge(alpha=np.float64(0.5)), {"a": (1, None)}, np.arange(2000.0), pd.Timedelta("1D"), mean_squared_error]
    values.append({f"2024-12-{day}" for day in range(10, 30)})
    program = (
        "import numpy as np, pandas as pd\nfrom sklearn.linear_model import Ridge\n"
        "from sklearn.metrics import mean_squared_error\n"
        "from skhybrid.model_selection.search.candidates import candidate_id\n"
        "values = [Ridge(alpha=0.5), {'a': [1, None]}, np.arange(2000.0),"
        " pd.Timedelta('1D'), mean_squared_error, {f'2024-12-{day}' for day in range(10, 30)}]\n"
        "print(candidate_id({'values': values}))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout.strip() == candidate_id({"values": values})
    assert as_plain(np.arange(2000.0)) != as_plain(np.append(np.arange(1999.0), 0.0))
    one, other = (ARXPrior(None, np.zeros(50), np.eye(50), 0.1, 5.0) for _ in range(2))
    assert as_plain(one) == as_plain(other)
    other.precision[25, 25] = 2.0  # which the text of a large array leaves out
    assert as_plain(one) != as_plain(other)
    assert as_plain({"Q_h": 6.0, "f": 0.3}) == as_plain({"f": 0.3, "Q_h": 6.0})
    assert candidate_id({"a": 1, "b": 2}) == candidate_id({"b": 2, "a": 1}) != candidate_id({"a": 2, "b": 1})


def _times(factor, power=1):
    def times(X):
        return factor * X**power

    return times


def test_functions_without_a_name_of_their_own_are_told_apart_by_what_they_do():
    functions = [
        lambda X: X[["T_oa"]],
        lambda X: X[["q_sol"]],
        lambda X, a=1: a,
        lambda X, a=2: a,
        _times(2),
        _times(3),
    ]
    assert len({as_plain(one) for one in functions}) == len(functions)
    assert as_plain(_times(2)) == as_plain(_times(2))
    assert as_plain(lambda X: [x + 1 for x in X]) == as_plain(lambda X: [x + 1 for x in X])
    bias, spread = make_scorer(lambda y, p: (p - y).mean()), make_scorer(lambda y, p: (p - y).std())
    assert as_plain(bias) != as_plain(spread)

    def endless(n):
        return endless(n - 1)

    assert "endless" in as_plain(endless)


def test_a_function_of_a_file_of_ones_own_is_told_apart_by_its_code(tmp_path, monkeypatch):
    """As the same script has it before and after a change, with another default, or below a decorator."""
    monkeypatch.syspath_prepend(str(tmp_path))
    head = "import functools\ndef plain(f):\n    return functools.wraps(f)(lambda *a: f(*a))\n"
    codes = ["def own(y, p):\n    return y", "def own(y, p):\n    return p", "def own(y, p=1):\n    return y"]
    seen = []
    for number, code in enumerate([*codes, "@plain\n" + codes[0], "@plain\n" + codes[1], codes[0]]):
        own = _imported(tmp_path / "my_functions.py", head + code, number)
        wrapped = FunctionTransformer(own), make_scorer(own), partial(own, 1)
        seen.append(tuple(map(as_plain, (own, *wrapped))))
    for same_use in zip(*seen, strict=True):
        assert len(set(same_use)) == 5
        assert same_use[0] == same_use[-1]
    assert as_plain(mean_squared_error) == "sklearn.metrics._regression.mean_squared_error"
    assert as_plain(candidate_id) == "skhybrid.model_selection.search.candidates.candidate_id"


def _imported(path, text, number):
    """The function ``own`` of a module that is imported anew; ``number`` tells its stamp from those before."""
    path.write_text(text, encoding="utf-8")
    os.utime(path, (number, number))
    sys.modules.pop(path.stem, None)
    importlib.invalidate_caches()
    return importlib.import_module(path.stem).own
