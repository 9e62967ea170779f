"""Files written whole or not at all, and damaged archives told from good ones."""
