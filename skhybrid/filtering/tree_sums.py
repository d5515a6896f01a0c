"""Sums over the leaves of regression trees."""

from __future__ import annotations

import numpy as np

from ._compile import compiled


@compiled
def sum_of_leaves(X, feature, threshold, left, right, missing_left, value, depth):
    """(n,) sums over the trees of the leaves that rows (n, n_features) reach after ``depth`` steps."""
    out = np.zeros(len(X))
    for i in range(len(X)):
        for tree in range(len(feature)):
            node = 0
            for _ in range(depth):
                x = X[i, feature[tree, node]]
                to_left = missing_left[tree, node] if np.isnan(x) else x <= threshold[tree, node]
                node = left[tree, node] if to_left else right[tree, node]
            out[i] += value[tree, node]
    return out
