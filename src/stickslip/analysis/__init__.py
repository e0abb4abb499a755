"""What a whole record tells: which questions are asked of it, in which order, and the answers side by side."""
