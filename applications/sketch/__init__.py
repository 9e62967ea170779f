"""From drawn keyframes to motion: a plane figure whose stiffness and boundary forces take it through all of them."""
