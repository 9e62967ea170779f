"""What the DICOM exporters share: the scan they refer to, codes, and who made an object."""
