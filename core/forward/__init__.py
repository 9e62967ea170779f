"""The one forward model: a composition of materials, walls, loads, interfaces and geometry, ready to be solved."""
