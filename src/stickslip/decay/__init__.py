"""The whole waveform of a free decay against a record."""
