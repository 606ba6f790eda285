"""Where the tip of an arm can go and how easily, sampled and kept; knows arms, no routes."""
