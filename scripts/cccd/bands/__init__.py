"""How far a surface may be off: a band for every vertex, and intervals of volumes.

`signs` is what can be seen at a vertex, `scale` and `calibration` turn it into millimetres, `conformal` holds
the formula with the guarantee.
"""

from cccd.bands.band import Band, estimate_band
from cccd.bands.calibration import Calibration

__all__ = ["Band", "Calibration", "estimate_band"]
