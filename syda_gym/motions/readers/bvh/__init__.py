"""BVH, motion capture as a tree of joints: the tree, its positions, and which joints are the arms."""
