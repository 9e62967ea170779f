"""Triangle surfaces and their files."""
