"""DICOM series: choice, geometry, pixels, pairs, writing."""
