"""Recordings that are lines of text: told apart by what they hold, not by how many columns they have."""
