"""Boosted regression trees as plain arrays, so that a model file can hold them and a short path costs little."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor

from ..._threads import one_openmp_thread
from ...filtering import sum_of_leaves

_DEPTH = 7
SETTINGS = {
    "max_iter": 90,
    "learning_rate": 0.12,
    "max_leaf_nodes": 24,
    "max_depth": _DEPTH,
    "min_samples_leaf": 20,
    "max_bins": 63,
    "l2_regularization": 1.0,
    "early_stopping": False,
    "random_state": 0,
}
_FIELDS = ("feature_idx", "num_threshold", "left", "right", "missing_go_to_left", "value")


class BoostedTrees(NamedTuple):
    """Sum of trees; a leaf has itself as both its children."""

    level: float  # of the target
    feature: np.ndarray  # (n_trees, n_nodes) int
    threshold: np.ndarray  # (n_trees, n_nodes); NaN goes where ``missing_left`` says
    left: np.ndarray  # (n_trees, n_nodes) int
    right: np.ndarray  # (n_trees, n_nodes) int
    missing_left: np.ndarray  # (n_trees, n_nodes) bool
    value: np.ndarray  # (n_trees, n_nodes) float32

    def predict(self, X: np.ndarray) -> np.ndarray:
        """(n,) values of rows (n, n_features), NaN where unknown."""
        n_nodes = self.feature.shape[1]
        for places, most in ((self.feature, X.shape[1]), (self.left, n_nodes), (self.right, n_nodes)):
            if places.min(initial=0) < 0 or places.max(initial=0) >= most:  # compiled code would read other memory
                raise ValueError("the trees do not fit the features; fit the model again.")
        nodes = (self.feature, self.threshold, self.left, self.right, self.missing_left, self.value)
        return np.asarray(self.level + sum_of_leaves(np.ascontiguousarray(X), *nodes, _DEPTH))


def fit_trees(X: np.ndarray, y: np.ndarray, weight: np.ndarray | None = None) -> BoostedTrees:
    """Boosted trees of a target (n,) by features (n, n_features), NaN where unknown; the same for the same rows."""
    X = np.where(np.isfinite(X).any(axis=0), X, 0.0)  # a feature of which nothing is known splits no node
    edges = None if weight is None else [_bin_edges(column, weight) for column in X.T]
    with one_openmp_thread():
        booster = HistGradientBoostingRegressor(**SETTINGS).fit(X if edges is None else _binned(X, edges), y, weight)
    nodes = [tree.nodes for (tree,) in booster._predictors]
    n_nodes = max(len(tree) for tree in nodes)
    found = {name: np.zeros((len(nodes), n_nodes), dtype=nodes[0].dtype[name]) for name in _FIELDS}
    for i, tree in enumerate(nodes):
        leaf = tree["is_leaf"].astype(bool)
        for name in _FIELDS:
            own = np.arange(len(tree)) if name in ("left", "right") else tree[name]
            found[name][i, : len(tree)] = np.where(leaf, own, tree[name])
        if edges is not None:
            for at in np.flatnonzero(~leaf & np.isfinite(tree["num_threshold"])):  # +inf: whether a value is known
                found["num_threshold"][i, at] = edges[tree["feature_idx"][at]][int(tree["num_threshold"][at])]
    level = float(np.ravel(booster._baseline_prediction)[0])
    feature, threshold, left, right, missing, value = found.values()
    whole = (feature.astype(np.int64), threshold, left.astype(np.int64), right.astype(np.int64))
    return BoostedTrees(level, *whole, missing.astype(bool), value.astype(np.float32))


def _bin_edges(column: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Upper ends of all bins of a feature but the last, as scikit-learn finds them by a sort for each."""
    known, n_bins = np.isfinite(column), int(SETTINGS["max_bins"])
    order = np.argsort(column[known])
    values, total = column[known][order], np.cumsum(weight[known][order])
    distinct = np.unique(values)
    if len(distinct) <= n_bins:
        return (distinct[1:] + distinct[:-1]) / 2.0
    return np.unique(values[np.searchsorted(total, np.linspace(0.0, total[-1], n_bins + 1)[1:-1])])


def _binned(X: np.ndarray, edges: list[np.ndarray]) -> np.ndarray:
    """Number of the bin of each value, NaN where it is unknown."""
    bins = np.column_stack([np.searchsorted(own, column) for own, column in zip(edges, X.T, strict=True)])
    return np.where(np.isfinite(X), bins, np.nan)
