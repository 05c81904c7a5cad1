"""Stage 9: two focal stacks to a disparity map, by networks; models and their weights."""
