"""One script a solver, each run as a child process with the Python that has that solver. None of them imports palpate."""
