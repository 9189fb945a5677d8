"""Readers of scans: a `cccd.request.Request` -> `cccd.containers.Structure`.

===================  ===============================================================================
module               holds
===================  ===============================================================================
``load``             `read_request`: its files on one grid, cropped to the organ
``row_files``        the files of a request: image, mask, boundary maps
``file_requests``    requests of a path and a caller's other arguments
``readers``          NIfTI, NRRD, MHA and what else SimpleITK reads
``grid``             `Volume`, and its move to another grid
``labels``           which labels, segments or regions are meant
``nifti_export``     volumes as NIfTI
===================  ===============================================================================
"""

from cccd.inputs.load import load_structure, read_request, structure_of_array

__all__ = ["load_structure", "read_request", "structure_of_array"]
