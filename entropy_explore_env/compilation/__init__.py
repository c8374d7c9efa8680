"""How kernels are compiled, cached and warmed."""
