"""How far a surface may be off: a band for every vertex, and intervals of volumes.

`signs` is what can be seen at a vertex, `calibration` turns it into millimetres, `readers` is what another
reader adds. `cccd_calibration` measures these, and draws surfaces within a band.
"""

from cccd.bands.band import Band, estimate_band
from cccd.bands.calibration import Calibration
from cccd.bands.readers import Reader

__all__ = ["Band", "Calibration", "Reader", "estimate_band"]
