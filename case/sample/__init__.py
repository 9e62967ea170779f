"""The simulated sample that comes with the program: its two scans, and the finished case."""
