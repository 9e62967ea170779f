"""Speed, beside other solvers on the same scene in one run: `palpate bench`."""
