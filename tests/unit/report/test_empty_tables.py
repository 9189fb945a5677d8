"""A comparison that cannot be made on a structure leaves an empty table."""

import pandas as pd
import pytest

from cccd.store import read_table, write_table


@pytest.mark.parametrize("table", [pd.DataFrame(), pd.DataFrame(columns=["case", "organ"])])
def test_a_table_without_rows_is_none(tmp_path, table):
    write_table(tmp_path / "table.csv", table)
    assert read_table(tmp_path / "table.csv") is None


def test_an_absent_table_is_none(tmp_path):
    assert read_table(tmp_path / "table.csv") is None
