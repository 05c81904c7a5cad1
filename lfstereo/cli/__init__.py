"""The program ``lfstereo``: one module per command."""
