"""Readers and sources of scans: a row of the cohort sheet -> `cccd.containers.Structure`.

===================  ===============================================================================
module               holds
===================  ===============================================================================
``load``             `load_structure`: a row's files on one grid, cropped to the organ
``row_files``        the files of a row: image, mask, boundary maps
``readers``          NIfTI, NRRD, MHA and what else SimpleITK reads
``nnunet``           nnU-Net's probabilities
``dicom``            image series, segmentations (SEG), structure sets (RTSTRUCT)
``contours``         drawn contours to ordered curves
``regions``          an organ found by its grey values, where there is no mask
``growing``          an organ grown from a seed in an image
``sources``          scans that come with a package
``phantoms``         scans of organs whose surface is known, made of ``implicit_solids``
``degraded``         structures without a mask: a noisy scan, damaged boundary maps (``corruptions``)
``phantom_files``    phantoms as a folder of files, for others
``grid``             `Volume`, and its move to another grid
``labels``           which labels, segments or regions are meant
``nifti_export``     volumes as NIfTI
===================  ===============================================================================
"""

from cccd.inputs.load import load_structure, structure_of_array

__all__ = ["load_structure", "structure_of_array"]
