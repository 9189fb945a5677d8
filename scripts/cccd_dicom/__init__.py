"""DICOM: series, segmentations (SEG), structure sets (RTSTRUCT), encapsulated STL."""
