"""Scans to try, to test and to compare with: phantoms whose surface is known, and what packages carry.

===================  ===============================================================================
module               holds
===================  ===============================================================================
``scans``            what a row's ``source`` stands for, if not files
``phantoms``         scans of organs whose surface is known, made of ``implicit_solids``
``packaged``         scans that come with a package
``heads``            a head drawn around a brain
``degraded``         structures without a mask: a noisy scan, damaged boundary maps (``corruptions``)
``whole_scans``      scans that are not cropped to their organ, to segment
===================  ===============================================================================
"""

#: Phantoms that ``snakemake phantoms`` writes, and the slice distances at which it scans each, in mm.
PHANTOM_ORGANS = (
    *("A", "H", "X", "bronchi", "kidney", "liver", "lungs", "shell", "sphere", "torus", "two_spheres"),
)
PHANTOM_DISTANCES_MM = (2, 5, 8)
