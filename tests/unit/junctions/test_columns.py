import numpy as np
import pytest

from cccd_junctions.columns import FeatureSchema

SCHEMA = FeatureSchema(length=1, turn=2)


def test_columns_stand_where_their_names_say_in_whatever_order_they_come():
    turn = np.array([[1.0, 2], [3, 4]])
    table = SCHEMA.assemble({"turn": turn, "length": np.array([5.0, 6])}, np.float32)
    assert table.dtype == np.float32
    assert np.array_equal(table[:, SCHEMA["turn"]], turn)
    assert np.array_equal(table[:, SCHEMA["length"]][:, 0], [5, 6])


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
