"""What one robot holds to be true, and what can be read off it.

What arguments of kernels are is said in `robots`.
"""
