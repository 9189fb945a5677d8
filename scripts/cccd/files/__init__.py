"""Every writer of surfaces: those of the table `cccd.settings.formats.FORMATS`, and scenes of whole cases.

`write.write_surface` calls them as ``write(path, surface, options)``. Everything is in mm RAS, and says so,
but where a standard wants it otherwise (glTF: metres with y up; DICOM: LPS). 3D Slicer takes meshes for LPS
unless a comment ``SPACE=RAS`` says otherwise, so that comment is there in the form Slicer reads.
"""
