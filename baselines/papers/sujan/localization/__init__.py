"""Errors of localization over the way (fig. 19), and what weighing them in the rating brings."""
