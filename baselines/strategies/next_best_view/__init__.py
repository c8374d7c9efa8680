"""What the rules of Sujan and Meggiolaro need: expected views, ratings, the edge of a cliff."""
