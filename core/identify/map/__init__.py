"""A smooth map of stiffness within the organ."""
