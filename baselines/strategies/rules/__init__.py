"""The rules of strategies: one file a rule, with its formula and its source."""
