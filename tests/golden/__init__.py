"""Golden missions: recorded results that code must give again."""
