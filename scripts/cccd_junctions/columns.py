"""Tables of features with named columns: a table is as wide as its columns say.

A network reads its input widths from the schemas, so that a feature is added in one place: its column, and
the function that measures it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from cccd.geometry.arrays import AnyArray

_Number = TypeVar("_Number", np.uint8, np.float32, np.float64)


@dataclass(frozen=True)
class Column:
    """One feature, or several of one kind side by side.

    Attributes
    ----------
    name : str
    unit : str
        ``1`` for numbers without one; what is scaled says how.
    meaning : str
    parts : tuple of str
        What the columns of one kind differ in: ``name[part]``; a single column has none.
    """

    name: str
    unit: str
    meaning: str
    parts: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the column, or of the columns, in a table."""
        return tuple(f"{self.name}[{part}]" for part in self.parts) or (self.name,)


class FeatureSchema:
    """The columns of a table of features, in order.

    Examples
    --------
    >>> turn = Column("turn", "1", "of its direction", ("cos", "sin"))
    >>> schema = FeatureSchema(Column("length", "px", "of a link"), turn)
    >>> schema.names, schema.width
    (('length', 'turn[cos]', 'turn[sin]'), 3)
    >>> schema.assemble({"turn": np.array([[1, 0]]), "length": np.array([5])}, np.float32).tolist()
    [[5.0, 1.0, 0.0]]
    """

    def __init__(self, *columns: Column):
        self.columns = columns
        self._slices: dict[str, slice] = {}
        names: list[str] = []
        for column in columns:
            self._slices[column.name] = slice(len(names), len(names) + len(column.names))
            names += column.names
        self.names = tuple(names)
        if len(set(self.names)) < len(names):
            raise ValueError("two columns of a table share a name")

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.names)

    def __getitem__(self, name: str) -> slice:
        """Where the column, or the columns, of a kind stand."""
        return self._slices[name]

    def assemble(self, values: Mapping[str, AnyArray], kind: type[_Number]) -> npt.NDArray[_Number]:
        """Put measured columns in order.

        Parameters
        ----------
        values : mapping of name to (N,) or (N, parts) array
            Of exactly the schema's columns.
        kind : type
            Of the table's numbers.

        Returns
        -------
        (N, width) array

        Raises
        ------
        ValueError
            When a column is missing, is none of the schema's, or has another number of parts.
        """
        if set(values) != set(self._slices):
            raise ValueError(f"columns {sorted(set(values) ^ set(self._slices))} are missing or not known")
        table = np.empty((len(next(iter(values.values()))), self.width), kind)
        for name, place in self._slices.items():
            column, width = values[name], place.stop - place.start
            if column.shape[1:] != (width,) and (column.ndim, width) != (1, 1):
                raise ValueError(f"column {name} has shape {column.shape}, not {width} parts")
            table[:, place] = column if column.ndim == 2 else column[:, None]
        return table
