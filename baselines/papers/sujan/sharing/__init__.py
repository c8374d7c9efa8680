"""Maps shared as summaries (Sujan & Meggiolaro, sect. 2.4): bits of maps and quadtrees, against errors."""
