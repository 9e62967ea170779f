"""Scans: DICOM series, and CTs in volume files."""
