"""Base commands over time, written down once so that agents are tuned and taught fast."""
