"""What `syda-gym reproduce-paper` does: the paper's tables, and what stands beside them."""
