"""Motion between two CTs from the images themselves, matched locally about a predicted motion."""
