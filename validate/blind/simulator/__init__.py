"""The blind check's own simulator: laws and element written out anew, on scikit-fem; nothing of core.fem or core.laws."""
