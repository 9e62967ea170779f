"""Commands of the applications, one a file; the table of `ui/cli/main.py` names them."""
