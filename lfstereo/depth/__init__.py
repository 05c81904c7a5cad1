"""Stage 7: disparity to metres, points and meshes, their files, and what a disparity is measured against."""
