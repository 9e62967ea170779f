"""Studies that put figures on what is claimed: each returns plain rows for JSON, none prints."""
