"""One file per question asked of a Record; nothing here looks at a simulator."""
