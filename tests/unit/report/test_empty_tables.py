"""A comparison that cannot be made on a structure leaves an empty table."""

import pandas as pd
import pytest

from cccd.report.tables import read_csv
from cccd.store import write_table


@pytest.mark.parametrize("table", [pd.DataFrame(), pd.DataFrame(columns=["case", "organ"])])
def test_a_table_without_rows_is_none(tmp_path, table):
    write_table(tmp_path / "table.csv", table)
    assert read_csv(tmp_path / "table.csv") is None


def test_an_absent_table_is_none(tmp_path):
    assert read_csv(tmp_path / "table.csv") is None
