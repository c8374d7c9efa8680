"""The planner: from what one robot knows to the viewpoint to which it drives next."""
