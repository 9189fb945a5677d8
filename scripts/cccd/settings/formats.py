"""The formats that a surface is written in, of all packages."""

from __future__ import annotations

from cccd.plugins import table

#: Red, green and blue (sRGB, 0 to 1) of an organ that nothing gives a colour.
COLOUR = (0.80, 0.47, 0.40)

#: Written wherever a format has room for text; ``SPACE=RAS`` is what 3D Slicer looks for.
NOTE = "CCCD surface; unit mm; SPACE=RAS"


#: Every format by its name.
FORMATS = dict(sorted(table("WRITERS").items()))
SOLID_FORMATS = tuple(name for name, form in FORMATS.items() if form.made_of == "solids")
TETRAHEDRA_FORMATS = tuple(name for name, form in FORMATS.items() if form.made_of == "tetrahedra")
#: Formats that hold all organs of a case.
CASE_FORMATS = SOLID_FORMATS + TETRAHEDRA_FORMATS
#: Names for the error band's inner and outer surface, surface_inner.stl and surface_outer.stl: meshes alone.
BAND_FORMATS = tuple(f"band.{name}" for name in ("3mf", "gii", "glb", "nii.gz", "obj", "ply", "stl", "vtp"))
