"""What the rule of RochaMI needs: candidates along the entropy gradient and their values."""
