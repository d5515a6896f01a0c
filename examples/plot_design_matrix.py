"""
Which disturbance model? A small design matrix
==============================================

The paper's second contribution is a method: train a matrix of disturbance models, ask by Bayesian regression which
ingredients help, compare how robust the cases are to their size, and take the least demanding of those that are
indistinguishable from the best.  This example runs a few of its 13032 candidates on a synthetic office, with baselines
in the same table.  It needs the extra ``networks`` for the candidates and ``bayes`` for the choice.
"""

# sphinx_gallery_thumbnail_number = 2
import matplotlib.pyplot as plt

from skhybrid import ARXRegressor, DisturbanceForecaster, HybridPredictor, OutputDisturbanceID
from skhybrid.datasets import make_office
from skhybrid.inspection import PosteriorDisplay, RobustnessDisplay
from skhybrid.model_selection import DesignMatrixSearchCV, RollingOriginSplit, design_matrix, select_case

# %%
# Four weeks are for training, and two more weeks for the choice.  The error of the chosen model must be measured on
# later rows.

office = make_office(n_days=42, random_state=0)
matrix = design_matrix(
    ["mlp", "lstm", "ridge", "profile"], cases=["case01", "case03", "case05"], disturbance="input", size="small"
)
print(matrix)

# %%
# Each candidate replaces the forecaster; the thermal network is identified only once per split.  With ``store=`` a
# search that was stopped continues.  Twenty epochs keep this page quick; the paper uses 1000 with patience 150.
# Baselines that do not forecast the disturbance, such as ARX, are given separately.

estimator = HybridPredictor(
    OutputDisturbanceID(known={"Q_h": 6.0}, n_starts=4, random_state=0),
    DisturbanceForecaster(max_epochs=20, residual_of=None, random_state=0),
    random_state=0,
)
cv = RollingOriginSplit(train="28D", test="7D", n_splits=2)
search = DesignMatrixSearchCV(estimator, matrix, cv=cv, baselines={"arx": ARXRegressor()})
search.fit(office.X, office.y)
results = search.results_
print(results.sort_values("rmse")[["name", "n_layers", "hidden_size", "rmse"]].head(8).to_string())

# %%
# The result of the paper's rules in words, and whether a baseline is enough.

choice = select_case(results, random_state=0)
print(choice)

# %%
# The evidence: which ingredients reduce the error (several sizes of one case do not count as several experiments) ...

print(choice.expressiveness.summary_.round(3).to_string())
PosteriorDisplay.from_estimator(choice.expressiveness).figure_.suptitle("Effect of each ingredient on the error")
plt.show()

# %%
# ... and how robust each case is to its size.

RobustnessDisplay.from_estimator(choice.robustness).figure_.suptitle("Errors of cases", x=0.99, ha="right")
plt.show()
