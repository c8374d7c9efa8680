"""The cliff of Sujan & Meggiolaro: five ways of mapping it from above, and the edge from the map."""
