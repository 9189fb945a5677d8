"""Write ``docs/measured.md`` from ``docs/measured``; with a run's ``results`` folder, from that run's tables.

python docs/write_measured.py [RESULTS]
"""

from __future__ import annotations

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent


def main(arguments: list[str]) -> None:
    """Copy the tables of the run that is named, if any, and write the page."""
    sys.path.insert(0, str(DOCS.parent / "scripts"))
    from cccd_paper.measured import keep_tables, write_page

    if arguments:
        keep_tables(Path(arguments[0]).resolve(), DOCS / "measured")
    (DOCS / "measured.md").write_text(write_page(DOCS), encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
