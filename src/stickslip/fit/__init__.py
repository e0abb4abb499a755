"""Questions that need the motion itself: the whole waveform against a record."""
