"""What drift does to the strategies of all papers, and which of them suffers."""
