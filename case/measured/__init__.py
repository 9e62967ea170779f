"""What a person measured on the slices of a case."""
