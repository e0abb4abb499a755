"""Curves of friction over velocity, displacement, load and time, against a record."""
