"""Contours of one scan carried over to another scan of the same patient, by the motion that both images show."""
