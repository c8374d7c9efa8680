"""Tests of rules: a package, since tests of worlds have some of their names."""
