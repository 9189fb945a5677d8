"""What this package adds to the core: see `cccd.plugins`."""

from cccd.plugins import Format

WRITERS = {
    "dcm": Format("contours on the scan's slices (RTSTRUCT)", "cccd_dicom.rtstruct.write", "dicom"),
    "seg.dcm": Format("voxels of the row's DICOM series (SEG)", "cccd_dicom.seg.write", "dicom"),
    "stl.dcm": Format("mesh within DICOM (encapsulated STL)", "cccd_dicom.encapsulated_stl.write", "dicom"),
}
