"""Stage 5: photographs of a board to a calibrated pair of cameras, and the rectification of their light fields."""
