"""Agents that are formulas: filters, lead, projection, and the tuning of their few numbers."""
