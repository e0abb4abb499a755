"""The table everyone meets at: a measured file, or a sampled simulation, in SI with its history."""
