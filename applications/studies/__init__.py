"""Studies of the applications, one a file, as `palpate validate` runs, tells and draws them."""
