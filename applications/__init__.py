"""The paper's further uses of a known stiffness: an organ that is touched, one that falls, a drawn figure that moves."""
