"""The virtual rig: what real sensors would have written of a simulated motion."""
