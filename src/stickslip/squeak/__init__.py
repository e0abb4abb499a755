"""Squeak: what a record tells of it, and which motion feeds it."""
