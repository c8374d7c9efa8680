"""What one robot holds to be true, and what can be read off it.

The arguments that kernels have in common are described in `robots`.
"""
