"""Friction laws against a record, with the exact engine in the loop."""
