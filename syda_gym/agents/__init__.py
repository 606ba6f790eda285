"""WHO acts: classical filters, learned predictors and residual policies under one interface."""
