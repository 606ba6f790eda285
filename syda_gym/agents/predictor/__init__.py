"""How the predictor is taught: by regression through the servo, on recorded streams."""
