"""`docs/measured.md`, written from the tables of one run: no figure on that page is typed.

`keep_tables` copies what the page shows out of a run into small CSV files, which are committed beside the
page; `write_page` makes the page of them. `docs/write_measured.py` does both.
"""

from cccd_paper.measured.kept import BENCHMARKS, TABLES, keep_tables
from cccd_paper.measured.page import write_page

__all__ = ["BENCHMARKS", "TABLES", "keep_tables", "write_page"]
