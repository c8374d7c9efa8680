"""The planar experiments of Sujan & Meggiolaro: five ways of choosing poses, one robot and two."""
