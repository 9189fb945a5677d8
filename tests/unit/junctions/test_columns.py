import numpy as np
import pytest

from cccd_junctions.columns import Column, FeatureSchema

SCHEMA = FeatureSchema(
    Column("length", "px", "of a link"), Column("turn", "1", "of its direction", ("cos", "sin"))
)


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
