"""A scan on the grid that a network expects, and what the network says back on the scan's own grid."""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

import numpy as np
import torch
from monai.data.meta_tensor import MetaTensor
from monai.transforms.spatial.array import Orientation, Spacing
from torch import Tensor

from cccd.geometry.arrays import AnyArray, FloatArray
from cccd_segmentation.plan import Plan, spacing_of

#: Spacings that differ by less are the same: no scan is resampled for so little.
_SAME_SPACING = 0.02


@dataclass(frozen=True)
class WorkingGrid:
    """The grid on which a network sees one scan.

    Attributes
    ----------
    affine : (4, 4) float64
        The scan's own, index to mm RAS.
    orientation : str
        Axis codes of the working grid.
    spacing : tuple of float
        Of the working grid, mm.
    """

    affine: FloatArray
    orientation: str
    spacing: tuple[float, float, float]

    @classmethod
    def of(cls, affine: FloatArray, plan: Plan) -> WorkingGrid:
        """Return the grid of a plan for a scan; spacings nearly the plan's own stay as they are."""
        own = spacing_of(affine, plan.orientation)
        near = np.abs(np.log(np.divide(own, plan.spacing))).max() < _SAME_SPACING
        return cls(affine, plan.orientation, own if near else plan.spacing)

    def _transforms(self, mode: str) -> tuple[Orientation, Spacing]:
        turn = Orientation(axcodes=self.orientation, labels=(("L", "R"), ("P", "A"), ("I", "S")))
        return turn, Spacing(pixdim=self.spacing, mode=mode, padding_mode="border")

    def _own(self, values: Tensor) -> MetaTensor:
        return MetaTensor(values, affine=torch.as_tensor(self.affine))

    def forward(self, data: AnyArray, mode: str = "bilinear") -> Tensor:
        """Move a volume (a, b, c) to the working grid: (1, h, w, d) float32."""
        turn, resample = self._transforms(mode)
        volume = self._own(torch.as_tensor(np.ascontiguousarray(data, np.float32))[None])
        return cast(MetaTensor, resample(turn(volume))).as_tensor().contiguous()

    def backward(self, values: Tensor, shape: tuple[int, int, int]) -> Tensor:
        """Move channels (c, h, w, d) of the working grid back to the scan's (c, a, b, c')."""
        turn, resample = self._transforms("bilinear")
        blank = self._own(torch.zeros(1, *shape))
        there = cast(MetaTensor, resample(turn(blank)))
        moved = MetaTensor(values.float(), affine=there.affine, applied_operations=there.applied_operations)
        return cast(MetaTensor, turn.inverse(resample.inverse(moved))).as_tensor().contiguous()
