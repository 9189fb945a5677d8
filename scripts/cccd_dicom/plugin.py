"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Format, Reader

READERS = {
    "series": Reader("cccd_dicom.readers.read_series"),
    "reference": Reader("cccd_dicom.references.referenced_series"),
    "SEG": Reader("cccd_dicom.readers.read_segments"),
    "RTSTRUCT": Reader("cccd_dicom.readers.read_regions"),
}

OPTIONS = {"in_its_series": "cccd_dicom.references.lies_in_its_series"}

#: They refer to the series that they were made on.
_REFERRING = ("dicom", "mesh", "cccd_dicom.seg.check_series")

WRITERS = {
    "dcm": Format("contours on the scan's slices (RTSTRUCT)", "cccd_dicom.rtstruct.write", *_REFERRING),
    "seg.dcm": Format("voxels of the row's DICOM series (SEG)", "cccd_dicom.seg.write", *_REFERRING),
    "stl.dcm": Format(
        "mesh within DICOM (encapsulated STL)", "cccd_dicom.encapsulated_stl.write", *_REFERRING
    ),
}
