"""Model files: saved models load unchanged, bad files are refused, and nothing in a file is executed."""

from __future__ import annotations

import errno
import os
import resource
from datetime import timedelta, timezone
from pathlib import Path
from typing import NamedTuple
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd
import pytest
import skops.io
from dateutil.tz import gettz, tzoffset, tzutc
from sklearn.base import clone
from sklearn.exceptions import NotFittedError
from sklearn.linear_model import Ridge
from sklearn.metrics import make_scorer, mean_pinball_loss
from sklearn.model_selection import GridSearchCV, TimeSeriesSplit
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler
from sklearn.tree import DecisionTreeRegressor

from skhybrid import ARXRegressor, DisturbanceForecaster, HybridPredictor, InputDisturbanceID
from skhybrid._files import atomic_path, write_text
from skhybrid.datasets import make_office
from skhybrid.exceptions import ModelFileError
from skhybrid.model_selection import RollingOriginSplit
from skhybrid.persistence import load_model, model_file, plain_objects, save_model
from skhybrid.persistence.folding import MARK, fold


def _data():
    rng = np.random.default_rng(0)
    X = pd.DataFrame(rng.normal(size=(200, 3)), columns=["T_oa", "q_sol", "T_za"])
    return X, X @ [1.0, 2.0, 3.0]


def _fitted():
    X, y = _data()
    model = Pipeline([("scale", StandardScaler()), ("ridge", Ridge())]).fit(X, y)
    return model, X


@pytest.fixture
def saved(tmp_path):
    model, X = _fitted()
    save_model(model, tmp_path / "model.skops")
    return tmp_path / "model.skops", model, X


# ------------------------------------------------------------------------------------------------- there and back
def test_a_model_comes_back_the_same(saved):
    path, model, X = saved
    np.testing.assert_array_equal(load_model(path).predict(X), model.predict(X))


def test_a_search_with_our_splitter_comes_back(tmp_path):
    X, y = _data()
    cv = RollingOriginSplit(train=50, test=10, gap=pd.Timedelta("0D"))
    search = GridSearchCV(Ridge(), {"alpha": [0.1, 1.0]}, cv=cv).fit(X, y)
    save_model(search, tmp_path / "m")
    back = load_model(tmp_path / "m")
    np.testing.assert_array_equal(back.predict(X), search.predict(X))
    assert repr(back.cv) == repr(cv)


@pytest.mark.parametrize(
    ("scoring", "cv"),
    [
        ("neg_mean_absolute_error", TimeSeriesSplit(2)),
        (["r2", "neg_root_mean_squared_error"], [(np.arange(100), np.arange(100, 200))]),
        (make_scorer(mean_pinball_loss, greater_is_better=False), None),
    ],
)
def test_a_search_with_a_scorer_and_a_splitter_of_scikit_learn_comes_back(tmp_path, scoring, cv):
    X, y = _data()
    refit = "r2" if isinstance(scoring, list) else True
    search = GridSearchCV(Ridge(), {"alpha": [0.1, 1.0]}, scoring=scoring, cv=cv, refit=refit).fit(X, y)
    save_model(search, tmp_path / "m")
    assert load_model(tmp_path / "m").score(X, y) == search.score(X, y)


def test_a_forecaster_that_has_nothing_to_learn_comes_back(tmp_path):
    X = pd.DataFrame({"T_oa": 5.0, "q_sol": 0.0}, index=pd.date_range("2024-01-01", periods=48, freq="1h"))
    save_model(DisturbanceForecaster("none").fit(X, np.ones(48)), tmp_path / "m")
    assert not load_model(tmp_path / "m").predict_from(X, [20]).any()


def test_a_search_over_an_estimator_of_ours_comes_back(tmp_path):
    office = make_office(n_days=6, random_state=0, sampling_time="1h")
    arx = GridSearchCV(
        Pipeline([("arx", ARXRegressor())]), {"arx__n_lags": [2, 4]}, cv=RollingOriginSplit(train="3D", test="1D")
    )
    arx.fit(office.X, office.y)
    save_model(arx, tmp_path / "m")
    np.testing.assert_array_equal(load_model(tmp_path / "m").predict(office.X), arx.predict(office.X))


@pytest.mark.parametrize("model", ["ridge", "lstm"])
def test_a_hybrid_comes_back_whole(tmp_path, model):
    """pandas objects, NamedTuples, a network declared as data, and the weights of a torch module as arrays."""
    office = make_office(n_days=9, random_state=0, sampling_time="30min")
    gray_box = InputDisturbanceID("1R1C", known={"Q_h": 6.0}, n_starts=1, random_state=0)
    forecaster = DisturbanceForecaster(model=model, max_epochs=1, **({} if model == "ridge" else {"hidden_size": 3}))
    hybrid = HybridPredictor(gray_box, forecaster, random_state=0).fit(office.X[:-48], office.y[:-48])
    save_model(hybrid, tmp_path / "m")
    back = load_model(tmp_path / "m")
    np.testing.assert_array_equal(back.predict(office.X[-48:]), hybrid.predict(office.X[-48:]))
    pd.testing.assert_series_equal(back.gray_box_.theta_, hybrid.gray_box_.theta_)
    assert back.get_params(deep=False).keys() == hybrid.get_params(deep=False).keys()
    again = clone(back).fit(office.X[:-48], office.y[:-48])  # torch may add up in another order
    np.testing.assert_allclose(again.predict(office.X[-48:]), hybrid.predict(office.X[-48:]), rtol=1e-11)


STAMPS = pd.date_range("2024-03-30", periods=30, freq="15min", tz="Europe/Amsterdam")
VALUES = {
    "series": pd.Series([1.0, np.nan], index=["C_w", "R_zw"], name="theta"),
    "frame": pd.DataFrame({"a": [1, 2], "b": ["x", None]}, index=pd.Index([3, 4], name="k")),
    "mixed columns": pd.DataFrame([[1.0, True]], columns=pd.Index(["n", 5], dtype=object)),
    "stamps": STAMPS,
    "stamps with an offset": pd.date_range("2018-01-01T00:15:00-06:00", periods=3, freq="15min"),
    "naive stamps": pd.DatetimeIndex(["2024-01-01", "2024-01-03"], name="t"),
    "stamped frame": pd.DataFrame({"t": STAMPS, "d": STAMPS - STAMPS[0], "v": 1.0}, index=STAMPS),
    "rows": pd.RangeIndex(2, 10, 2, name="r"),
    "pairs": pd.MultiIndex.from_tuples([("a", 1), ("b", 2)], names=["x", "y"]),
    "duration": pd.Timedelta("15min"),
    "stamp": pd.Timestamp("2024-03-31 03:00", tz="Europe/Amsterdam"),
    "nested": {"a": (1, [2.5, None]), 3: {"x"}, (1, 2): frozenset({4})},
    "objects": np.array([(1, 2), None, "x"], dtype=object),
    "mark": {"__skhybrid__": "object"},
    "class": RollingOriginSplit,
    "path": Path("searches/store.db"),
    "duration of Python": timedelta(days=-1, hours=3, microseconds=5),
}


@pytest.mark.parametrize("name", VALUES)
def test_what_an_estimator_may_hold_comes_back(tmp_path, name):
    model = Ridge().fit(*_data())
    model.held_ = VALUES[name]
    save_model(model, tmp_path / "m")
    back = load_model(tmp_path / "m").held_
    assert type(back) is type(VALUES[name])
    if isinstance(back, pd.DataFrame):
        pd.testing.assert_frame_equal(back, VALUES[name], check_freq=True)
    elif isinstance(back, pd.Series):
        pd.testing.assert_series_equal(back, VALUES[name])
    elif isinstance(back, pd.Index):
        pd.testing.assert_index_equal(back, VALUES[name], exact=True)
        assert getattr(back, "freq", None) == getattr(VALUES[name], "freq", None)
    elif isinstance(back, np.ndarray):
        assert back.tolist() == VALUES[name].tolist()
    else:
        assert back == VALUES[name]


def test_what_cannot_be_written_as_data_is_refused(tmp_path):
    class Local(NamedTuple):
        a: int

    X, y = _data()
    with pytest.raises(TypeError, match="cannot be written as data"):
        save_model(FunctionTransformer(lambda x: x).fit(X), tmp_path / "m")
    with pytest.raises(TypeError, match=r"Tree, which cannot be written as data that is safe to read"):
        save_model(DecisionTreeRegressor(max_depth=2).fit(X, y), tmp_path / "m")
    model = Ridge().fit(X, y)
    model.held_ = pd.offsets.Hour(1)
    with pytest.raises(TypeError, match=r"contains a pandas.*Hour, .* fit with text or numbers in its place"):
        save_model(model, tmp_path / "m")
    model.held_ = Local(1)
    with pytest.raises(TypeError, match=r"Ridge\.held_ is a"):
        save_model(model, tmp_path / "m")
    with pytest.raises(ValueError, match="metadata='hall' must be a mapping of names to texts"):
        save_model(Ridge().fit(X, y), tmp_path / "m", "hall")
    with pytest.raises(NotFittedError):
        save_model(Ridge(), tmp_path / "m")
    assert list(tmp_path.iterdir()) == []


def test_time_zones_come_back_by_name_or_are_refused(tmp_path):
    X, y = _data()
    model = Ridge().fit(X, y)
    kept = [ZoneInfo("Europe/Berlin"), timezone(timedelta(hours=-5)), tzoffset(None, 3600), tzutc()]
    model.index_ = [pd.date_range("2024-03-30", periods=5, freq="12h", tz=zone) for zone in kept]
    save_model(model, tmp_path / "m")
    for before, after in zip(model.index_, load_model(tmp_path / "m").index_, strict=True):
        assert [str(stamp) for stamp in before] == [str(stamp) for stamp in after]
    model.index_ = pd.date_range("2024", periods=3, tz=ZoneInfo("Etc/GMT+6"))
    save_model(model, tmp_path / "m")
    assert str(load_model(tmp_path / "m").index_.tz) == "Etc/GMT+6"
    try:
        model.index_ = pd.date_range("2024", periods=3, tz=gettz("Europe/Berlin"))
    except AttributeError:  # pandas 2.2.0 has no such stamps
        return
    with pytest.raises(ValueError, match=r"time zone tzfile.* cannot be saved; give stamps one by its name"):
        save_model(model, tmp_path / "m")


# ------------------------------------------------------------------------------------------------------ refused files
@pytest.mark.parametrize("kept", [0, 5, 60, 100, 101, 500, -1])
def test_a_truncated_file_is_refused(saved, kept):
    path, *_ = saved
    path.write_bytes(path.read_bytes()[:kept])
    with pytest.raises(ModelFileError, match=path.name):
        load_model(path)


def test_a_file_with_any_flipped_bit_is_refused(saved):
    path, *_ = saved
    content = path.read_bytes()
    places = [*range(120), *np.random.default_rng(0).integers(120, len(content), 200).tolist()]
    for place in places:
        changed = bytearray(content)
        changed[place] ^= 1 << (place % 8)
        path.write_bytes(bytes(changed))
        with pytest.raises(ModelFileError):
            load_model(path)


def test_another_version_is_refused_and_a_patch_is_not(saved, monkeypatch):
    path, model, X = saved
    monkeypatch.setattr(model_file, "__version__", "7.3.1")
    save_model(model, path)
    monkeypatch.setattr(model_file, "__version__", "7.3.2")
    np.testing.assert_array_equal(load_model(path).predict(X), model.predict(X))
    monkeypatch.setattr(model_file, "__version__", "7.4.0")
    with pytest.raises(ModelFileError, match=r"saved by skhybrid 7\.3\.1, but this is 7\.4\.0"):
        load_model(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"none\.skops"):
        load_model(tmp_path / "none.skops")


# -------------------------------------------------------------------------------------------------------------- writing
def _write_half(path):
    path.write_text("half", encoding="utf-8")
    raise ValueError("no more")


def test_a_write_that_fails_leaves_what_was_there(tmp_path):
    path = tmp_path / "deep" / "report.html"
    with atomic_path(path) as made:
        made.write_text("old", encoding="utf-8")
    with pytest.raises(ValueError, match="no more"), atomic_path(path) as made:
        _write_half(made)
    assert path.read_text(encoding="utf-8") == "old"
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]


def test_a_file_that_is_replaced_keeps_its_permissions(tmp_path):
    path = tmp_path / "model.skops"
    path.touch(mode=0o600)
    with atomic_path(path) as made:
        made.write_text("new", encoding="utf-8")
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_link_or_a_pipe_is_written_to_and_not_replaced(tmp_path):
    link, kept, pipe = tmp_path / "link", tmp_path / "disk" / "model.skops", tmp_path / "pipe"
    link.symlink_to(kept)
    write_text(link, "new")
    assert (link.is_symlink(), kept.read_text(encoding="utf-8")) == (True, "new")
    os.mkfifo(pipe)
    with open(os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)) as reader:
        write_text(pipe, "sent")
        assert (pipe.is_fifo(), reader.read()) == (True, "sent")


def _limited(size):
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, most))


def test_a_full_disk_is_named_and_leaves_the_old_model(saved):
    path, model, _ = saved
    old = path.read_bytes()
    _limited(500)
    try:
        with pytest.raises(OSError, match=rf"cannot write: File too large: '{path}'"):
            save_model(model, path)
    finally:
        _limited(resource.RLIM_INFINITY)
    assert path.read_bytes() == old
    assert [p.name for p in path.parent.iterdir()] == [path.name]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO, errno.EDQUOT])
def test_a_disk_that_tells_late_leaves_the_old_model(saved, monkeypatch, number):
    path, model, _ = saved
    old = path.read_bytes()

    def fsync(_):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(os, "fsync", fsync)
    with pytest.raises(OSError, match=rf"{os.strerror(number)}: '{path}'"):
        save_model(model, path)
    assert path.read_bytes() == old
    assert [p.name for p in path.parent.iterdir()] == [path.name]


def test_a_place_that_cannot_be_written_is_named(saved, monkeypatch):
    path, model, _ = saved
    with pytest.raises(IsADirectoryError, match=rf"Is a directory: '{path.parent}'"):
        save_model(model, path.parent)
    with pytest.raises(FileNotFoundError, match="there is no model file"):
        load_model(path / "m")
    with pytest.raises(OSError, match=rf"cannot write: (Not a directory|File exists): '{path}/m'"):
        save_model(model, path / "m")
    old = path.read_bytes()
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write to every file
    with pytest.raises(PermissionError, match=rf"Permission denied: '{path}'"):
        save_model(model, path)
    assert path.read_bytes() == old
    assert len(list(path.parent.iterdir())) == 1


def test_large_arrays_and_even_stamps_come_back_bit_for_bit(tmp_path):
    rng = np.random.default_rng(0)
    gram = (lambda a: a.T @ a)(rng.normal(size=(50, 40)))
    gram[0, 1] = gram[1, 0] = np.nan
    arrays = {
        "symmetric": gram,
        "stack": rng.normal(size=(20, 30, 4)),
        "other order": np.asfortranarray(rng.normal(size=(40, 40))),
        "nearly symmetric": np.where(np.arange(1600).reshape(40, 40) == 7, -0.0, np.zeros((40, 40))),
    }
    index = pd.date_range("2024-03-30 22:00", periods=200, freq="15min", tz="Europe/Amsterdam").as_unit("s")
    model = ARXRegressor(columns={"values": arrays, "index": [index, index[::-1], index[[0, 1, 3]]]})
    model.sampling_time_ = 1  # what counts as fitted
    model._tail = 1
    save_model(model, tmp_path / "m")
    found = load_model(tmp_path / "m").columns
    for name, value in arrays.items():
        back = found["values"][name]
        assert (back.tobytes("A"), back.shape, back.flags.c_contiguous) == (
            value.tobytes("A"), value.shape, value.flags.c_contiguous,
        ), name  # fmt: skip
        assert back.flags.writeable
    for back, given in zip(found["index"], [index, index[::-1], index[[0, 1, 3]]], strict=True):
        pd.testing.assert_index_equal(back, given, exact=True)


def test_a_class_that_this_version_lacks_is_told_from_a_library_that_is_missing(monkeypatch):
    for name in ("skhybrid.hybrid.blend:Blend", "skhybrid.hybrid.tables:Absent"):
        with pytest.raises(ValueError, match=f"it names '{name}', which this version does not have; fit and save it"):
            plain_objects.own_class(name)

    imported = plain_objects.importlib.import_module

    def without_torch(module, package=None):
        if "networks" in module:
            raise ModuleNotFoundError("No module named 'torch'", name="torch")
        return imported(module, package)

    monkeypatch.setattr(plain_objects.importlib, "import_module", without_torch)
    with pytest.raises(ModuleNotFoundError, match="torch"):
        plain_objects.own_class("skhybrid.forecasting.networks.fitted:FittedNetwork")
    network = {MARK: "object", "type": "skhybrid.forecasting.networks.fitted:FittedNetwork", "state": {}}
    with pytest.raises(ModelFileError, match=r'needs torch; install it with pip install "skhybrid\[networks\]"\.$'):
        model_file._decode(skops.io.dumps(fold(network)), "a.skops")
