"""Import: scans, contours or surfaces into a case folder."""
