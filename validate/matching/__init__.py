"""How well local matching of two CTs finds a known motion, and whether its stated errors hold."""
