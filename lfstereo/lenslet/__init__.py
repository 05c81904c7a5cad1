"""Stage 2: white images to the lattice of micro-images."""
