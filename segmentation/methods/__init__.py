"""Methods that are not tied to an organ: random walker, optimal surface, edges below a voxel."""
