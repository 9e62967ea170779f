"""Contributions to the energy beside the cells' own: loads, springs, walls, interfaces. One kind a file; they add
up.
"""
