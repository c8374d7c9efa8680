"""What the rules of Bhattacharya, Michael and Kumar need: cells, controls, uncertainty."""
