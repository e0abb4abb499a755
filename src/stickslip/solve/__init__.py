"""The exact solver: closed forms between events, first exits that are certified."""
