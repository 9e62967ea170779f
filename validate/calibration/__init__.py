"""Are the reported intervals right? Effect-free and other patients of several simulators, drawn from the prior."""
