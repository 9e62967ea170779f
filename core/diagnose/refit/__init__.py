"""Effects refitted in full, in variants and in pairs."""
