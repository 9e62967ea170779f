"""A body on a bench as a case states it: its mesh, patches and states."""
