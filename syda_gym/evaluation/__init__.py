"""HOW GOOD it is: chains as episodes, statistics, the benchmark, the demo and the report."""
