"""How `palpate validate` runs and tells its studies."""
