"""Stage 10: train and evaluate the networks."""
