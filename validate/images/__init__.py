"""What the second scan's image adds on real CTs whose second state is simulated with nothing hidden: `palpate validate images`."""
