"""Stage 8: captures, boards and focal stacks of scenes whose depth is known."""
