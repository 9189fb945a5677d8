import numpy as np
import pytest

from cccd_junctions.columns import FeatureSchema

SCHEMA = FeatureSchema(length=1, turn=2)


@pytest.mark.parametrize(
    "values",
    [
        {"length": np.zeros(2)},
        {"length": np.zeros(2), "turn": np.zeros((2, 2)), "area": np.zeros(2)},
        {"length": np.zeros(2), "turn": np.zeros((2, 3))},
        {"length": np.zeros(2), "turn": np.zeros(2)},
    ],
)
def test_missing_unknown_and_misshapen_columns_are_refused(values):
    with pytest.raises(ValueError, match=r"length|turn|area"):
        SCHEMA.assemble(values, np.float64)
