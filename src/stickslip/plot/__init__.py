"""Figures; they know the results, and no result knows them."""
