"""Stage 3: a raw mosaic to linear RGB."""
