"""The blind check of the diagnosis: sealed answers, cases of a simulator of its own."""
