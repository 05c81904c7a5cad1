"""Stage 6: a light field to a focal stack or a picture, and depth from focus."""
