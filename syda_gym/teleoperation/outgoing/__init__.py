"""Where commands go: simulated and real robots, the network, a list."""
