"""Tables of features with named columns: a table is as wide as its columns say.

A network reads its input widths from the schemas, so that a feature is added in one place: its column, and
the function that measures it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from cccd.geometry.arrays import AnyArray

_Number = TypeVar("_Number", np.uint8, np.float32, np.float64)


class FeatureSchema:
    """The columns of a table of features, in order: how many of each kind stand side by side.

    Examples
    --------
    >>> schema = FeatureSchema(length=1, turn=2)
    >>> schema.width, schema["turn"]
    (3, slice(1, 3, None))
    >>> schema.assemble({"turn": np.array([[1, 0]]), "length": np.array([5])}, np.float32).tolist()
    [[5.0, 1.0, 0.0]]
    """

    def __init__(self, **widths: int):
        self._slices: dict[str, slice] = {}
        self.width = 0
        for name, width in widths.items():
            self._slices[name] = slice(self.width, self.width + width)
            self.width += width

    def __getitem__(self, name: str) -> slice:
        """Where the columns of a kind stand."""
        return self._slices[name]

    def assemble(self, values: Mapping[str, AnyArray], kind: type[_Number]) -> npt.NDArray[_Number]:
        """Put measured columns in order.

        Parameters
        ----------
        values : mapping of name to (N,) or (N, columns) array
            Of exactly the schema's kinds.
        kind : type
            Of the table's numbers.

        Returns
        -------
        (N, width) array

        Raises
        ------
        ValueError
            When a kind is missing, is none of the schema's, or has another number of columns.
        """
        if set(values) != set(self._slices):
            raise ValueError(f"columns {sorted(set(values) ^ set(self._slices))} are missing or not known")
        table = np.empty((len(next(iter(values.values()))), self.width), kind)
        for name, place in self._slices.items():
            column, width = values[name], place.stop - place.start
            if column.shape[1:] != (width,) and (column.ndim, width) != (1, 1):
                raise ValueError(f"column {name} has shape {column.shape}, not {width} columns")
            table[:, place] = column if column.ndim == 2 else column[:, None]
        return table
