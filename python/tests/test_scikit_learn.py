"""Conformity with scikit-learn."""

import pytest
from sklearn.utils.estimator_checks import parametrize_with_checks

from decoupler import FuzzyDecoder, NetworkRegressor, RadialBasisDecoder, RidgeDecoder

ESTIMATORS = [
    NetworkRegressor(epochs=100, random_state=0),
    NetworkRegressor(method="br", epochs=50, random_state=0),
    NetworkRegressor(method="scg", scaling="whiten", starts=2, random_state=0),
    RidgeDecoder(),
    RadialBasisDecoder(random_state=0),
    FuzzyDecoder(random_state=0),
]


@pytest.mark.filterwarnings("ignore::sklearn.exceptions.ConvergenceWarning")
@parametrize_with_checks(ESTIMATORS)
def test_check(estimator, check):
    check(estimator)
