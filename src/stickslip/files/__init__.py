"""Reading and writing records; one file per format."""
