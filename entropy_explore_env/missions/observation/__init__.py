"""What robots observe: the parts of one flat float32 vector, written by compiled code."""
