"""What one robot holds to be true, and what can be read off it."""
