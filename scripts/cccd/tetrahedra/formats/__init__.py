"""The files that tetrahedra are written to: one module per format, as in `cccd.surface.formats`.

Each has ``write_tetrahedra(path, filled)``, and ``write(path, surface, scan)``, which fills one surface alone
and returns a report.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["HEAD", "rows"]

#: Written wherever a format has room for text.
HEAD = "CCCD tetrahedra; unit mm; space RAS"


def rows(numbers: npt.ArrayLike, form: str, separator: str = " ") -> str:
    """Write a row of numbers per line."""
    table = np.asarray(numbers)
    line = separator.join([form] * table.shape[1])
    return "\n".join(line % tuple(row) for row in table.tolist())
