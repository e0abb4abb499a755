"""Friction laws: each one a table of linear modes with exits, one file per law."""
