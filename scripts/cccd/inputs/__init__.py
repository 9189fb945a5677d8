"""Readers of scans: a row of the cohort sheet -> `cccd.containers.Structure`.

===================  ===============================================================================
module               holds
===================  ===============================================================================
``load``             `load_structure`: a row's files on one grid, cropped to the organ
``row_files``        the files of a row: image, mask, boundary maps
``readers``          NIfTI, NRRD, MHA and what else SimpleITK reads
``nnunet``           nnU-Net's probabilities
``drawn_contours``   drawn contours to ordered curves
``regions``          a picture of what was read
``grid``             `Volume`, and its move to another grid
``labels``           which labels, segments or regions are meant
``nifti_export``     volumes as NIfTI
===================  ===============================================================================
"""

from cccd.inputs.load import load_structure, structure_of_array

__all__ = ["load_structure", "structure_of_array"]
